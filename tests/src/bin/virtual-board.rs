//! Runs a firmware ELF on the virtual drive board, in closed loop with a simulated machine.

use arso_core::Mode;
use arso_tests::virtual_board::image::{Image, SETTINGS};
use arso_tests::virtual_board::profile::{self, Cost, Counts};
use arso_tests::virtual_board::rig::{Period, Switches};
use arso_tests::virtual_board::serial::{self, Bridge, Listener};
use arso_tests::virtual_board::{Rig, Stop};
use clap::Parser;
use clap::builder::PossibleValuesParser;
use host_sim::capture::{Capture, Origin, read_defmt};
use host_sim::chain::controlled_mass;
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile, SETTLING_BAND};
use host_sim::error::Error;
use host_sim::machine::Kind;
use host_sim::output::{print, write_file};
use host_sim::report::time;
use host_sim::simulate::scenario::{SCENARIOS, Scenario};
use serde_json::{Value, json};
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Runs the firmware that is flashed, unmodified, on an emulated drive board: it proves its signs,
/// then makes one experiment, or it plays its excitation.
#[derive(Debug, Parser)]
#[command(version)]
struct Cli {
    /// The firmware.
    #[arg(value_name = "FW.elf")]
    elf: PathBuf,
    /// Description of the drive the firmware was built for; the paper's rig when not given.
    #[arg(long, value_name = "DRIVE.toml")]
    drive: Option<PathBuf>,
    /// What is really there, when it differs from what the drive file says.
    #[arg(long, value_name = "PLANT.toml")]
    plant: Option<PathBuf>,
    /// The experiment.
    #[arg(long, value_name = "NAME", default_value = "move", value_parser = scenario_names())]
    scenario: String,
    /// Control periods of the experiment.
    #[arg(long, default_value_t = 1200, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    periods: u32,
    /// Play the excitation instead.
    #[arg(long, conflicts_with_all = ["scenario", "periods"])]
    excite: bool,
    #[command(flatten)]
    line: Line,
    /// Write what the firmware logged, a raw defmt stream.
    #[arg(long, value_name = "FILE")]
    rtt: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
}

/// What is printed instead of a few figures.
#[derive(Debug, clap::Args)]
struct Output {
    /// Print every control period of the experiment, or of the excitation, as CSV.
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
    /// Print what each part of the control interrupt costs, on average over the periods of the experiment.
    #[arg(long, conflicts_with_all = ["excite", "csv", "json"])]
    profile: bool,
}

/// The board as something to talk to.
#[derive(Debug, clap::Args)]
struct Line {
    /// Instead of an experiment run on in step with this machine's clock, the run switch closed and the
    /// target switches at 0 (firmware of another drive than DRIVE.toml's waits to be told over its link), with the drive's serial port as a pseudo-terminal. The first line of the
    /// output names it. Ctrl-C or the end of standard input end it.
    #[arg(long, conflicts_with_all = ["tcp", "scenario", "periods", "excite", "csv", "json"])]
    serial: bool,
    /// The same with the serial port as a TCP server, for one client at a time; port 0 takes a free one.
    #[arg(
        long,
        value_name = "HOST:PORT",
        conflicts_with_all = ["scenario", "periods", "excite", "csv", "json"]
    )]
    tcp: Option<String>,
    /// The flash in which the drive keeps its settings: read from there where the file is, and written there at the
    /// end.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scenario", "periods", "excite", "csv", "json"])]
    flash: Option<PathBuf>,
}

impl Line {
    fn wanted(&self) -> bool {
        self.serial || self.tcp.is_some()
    }

    fn require_port(&self) -> Result<(), Error> {
        if self.wanted() {
            return Ok(());
        }
        Err(Error::Usage(
            "--flash is for a board with a port: --serial or --tcp".into(),
        ))
    }
}

/// Puts what a board has kept into the flash of an image; where there is no file yet nothing has been kept.
fn keep_flash(image: &mut Image, path: &Path) -> Result<(), Error> {
    if !path.exists() {
        return Ok(());
    }
    let kept = std::fs::read(path).map_err(Error::read(path))?;
    let flash = &mut image.flash[SETTINGS..];
    if kept.len() != flash.len() {
        return Err(Error::Input {
            place: path.display().to_string(),
            message: format!("has {} bytes, and the flash {}", kept.len(), flash.len()),
        });
    }
    flash.copy_from_slice(&kept);
    Ok(())
}

fn scenario_names() -> PossibleValuesParser {
    let asked_for = |scenario: &&Scenario| Switches::target_of(scenario).is_some();
    PossibleValuesParser::new(
        SCENARIOS
            .iter()
            .filter(asked_for)
            .map(|scenario| scenario.name),
    )
}

/// The serial port is to be closed.
static END: AtomicBool = AtomicBool::new(false);

fn main() -> ExitCode {
    match Cli::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

impl Cli {
    fn run(self) -> Result<(), Error> {
        let bytes = std::fs::read(&self.elf).map_err(Error::read(&self.elf))?;
        let place = self.elf.display().to_string();
        let mut image = Image::parse(&bytes).map_err(|message| Error::Input {
            place: place.clone(),
            message,
        })?;
        if let Some(path) = &self.line.flash {
            self.line.require_port()?;
            keep_flash(&mut image, path)?;
        }
        let drive = Drive::load(self.drive.as_deref())?;
        let plant = match &self.plant {
            None => PlantFile::from(&drive),
            Some(path) => PlantFile::load(path)?,
        };
        plant.require_fit(&drive)?;
        let scenario = Scenario::named(&self.scenario).expect("clap knows the names");

        let stopped = |stop: Stop| Error::Simulation(stop.to_string());
        let start = Instant::now();
        let mut rig = Rig::start(&image, &drive, &plant, |_| {}).map_err(stopped)?;
        if self.line.wanted() {
            return self.serve(&mut rig, &bytes, &place, &drive);
        }
        let (title, result, counts) = self.play(&mut rig, scenario, &drive, &plant);
        let elapsed = start.elapsed().as_secs_f64();
        if let Some(path) = &self.rtt {
            write_file(path, &rig.log)?;
        }
        let capture = read_defmt(&bytes, &place, &rig.log[..], |_| ())?;
        // What another drive's firmware did on this machine means nothing.
        require_same_drive(&capture, &drive)?;
        for message in &capture.messages {
            eprintln!("{message}");
        }
        let periods = result.map_err(stopped)?;

        if self.output.profile {
            let running = periods.iter().filter(|period| period.enabled).count();
            print(&self.parts(&counts, running)?)?;
            return self.require_arrival(&capture, &rig, scenario, drive.control.sample_time);
        }
        if self.output.csv {
            print(&table(&periods, drive.control.sample_time))?;
            return self.require_arrival(&capture, &rig, scenario, drive.control.sample_time);
        }
        let summary = summary(&rig, &capture, &periods, elapsed);
        if self.output.json {
            print(&format!("{summary:#}\n"))?;
            return self.require_arrival(&capture, &rig, scenario, drive.control.sample_time);
        }
        print(&figures(&title, &summary, drive.kind))?;
        self.require_arrival(&capture, &rig, scenario, drive.control.sample_time)
    }

    /// Title and course of what is asked for, and what its control interrupt has executed.
    fn play(
        &self,
        rig: &mut Rig,
        scenario: &Scenario,
        drive: &Drive,
        plant: &PlantFile,
    ) -> (String, Result<Vec<Period>, Stop>, Counts) {
        let mut counts = Counts::default();
        if self.excite {
            let title = "excitation: current in open loop".into();
            return (title, rig.excite(), counts);
        }
        let title = format!("{}: {}", scenario.name, scenario.title(drive.kind));
        let result = rig.commission().and_then(|()| {
            rig.begin(scenario, plant)?;
            if self.output.profile {
                rig.board.begin_profile();
            }
            let periods = rig.periods(self.periods)?;
            counts = rig.board.end_profile();
            rig.end()?;
            Ok(periods)
        });
        (title, result, counts)
    }

    /// What each part of the control interrupt costs.
    fn parts(&self, counts: &Counts, periods: usize) -> Result<String, Error> {
        let parts = profile::by_part(counts, &self.elf).map_err(Error::Report)?;
        let each = |sum: u64| sum as f64 / periods.max(1) as f64;
        let mut text = format!("{:<20} {:>12} {:>8}\n", "part", "instructions", "cycles");
        let mut all = Cost::default();
        for (name, cost) in &parts {
            all.instructions += cost.instructions;
            all.cycles += cost.cycles;
            text += &row(name, each(cost.instructions), each(cost.cycles));
        }
        Ok(text + &row("all", each(all.instructions), each(all.cycles)))
    }

    /// Runs on with the serial port open.
    fn serve(&self, rig: &mut Rig, elf: &[u8], place: &str, drive: &Drive) -> Result<(), Error> {
        let stopped = |stop: Stop| Error::Simulation(stop.to_string());
        // Closed from the beginning on, the run switch lets the switches ask nothing.
        rig.switches(Switches::run(0));
        rig.period().map_err(stopped)?;
        let capture = read_defmt(elf, place, &rig.log[..], |_| ())?;
        match require_same_drive(&capture, drive) {
            Ok(()) => rig.switch_on().map_err(stopped)?,
            // Nothing is asked of it but over its link, by which it can be told.
            Err(error) => eprintln!("warning: {error}"),
        }
        for message in &capture.messages {
            eprintln!("{message}");
        }
        let usage = |what: String| move |error| Error::Usage(format!("{what}: {error}"));
        ctrlc::set_handler(|| END.store(true, Ordering::Relaxed))
            .map_err(|error| Error::Usage(format!("Ctrl-C cannot be caught: {error}")))?;
        // Reading blocks, so a thread does it, which ends with the program.
        std::thread::spawn(|| {
            let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
            END.store(true, Ordering::Relaxed);
        });
        if let Some(address) = &self.line.tcp {
            let no = usage(format!("cannot listen on {address}"));
            let listener = Listener::new(address);
            let (listener, address) = listener
                .and_then(|listener| listener.address().map(|address| (listener, address)))
                .map_err(no)?;
            print(&format!("tcp {address}\n"))?;
            self.bridge(rig, Bridge::new(listener))
        } else {
            let no = usage("no pseudo-terminal".into());
            let (terminal, path) = serial::open_terminal().map_err(no)?;
            print(&format!("serial port {path}\n"))?;
            self.bridge(rig, Bridge::new(terminal))
        }
    }

    fn bridge<P: Read + Write>(&self, rig: &mut Rig, mut bridge: Bridge<P>) -> Result<(), Error> {
        // There is no end to wait for: the log is written as it comes.
        let mut file = match &self.rtt {
            Some(path) => Some((path, File::create(path).map_err(Error::write(path))?)),
            None => None,
        };
        let log = |bytes: &[u8]| match &mut file {
            Some((path, file)) => file
                .write_all(bytes)
                .map_err(|error| Ended::Error(Error::write(path)(error))),
            None => Ok(()),
        };
        let late = || eprintln!("warning: this machine is too slow for real time");
        serial::run(rig, &mut bridge, &END, log, late).map_err(|ended| match ended {
            Ended::Stop(stop) => Error::Simulation(stop.to_string()),
            Ended::Error(error) => error,
        })?;
        match &self.line.flash {
            Some(path) => write_file(path, &rig.board.flash()[SETTINGS..]),
            None => Ok(()),
        }
    }

    /// A run that a fault ended, or whose controlled mass is not within 2 % of its target, is a failed run.
    fn require_arrival(
        &self,
        capture: &Capture,
        rig: &Rig,
        scenario: &Scenario,
        sample_time: f64,
    ) -> Result<(), Error> {
        let fault = capture.records.iter().enumerate().find_map(|(k, record)| {
            let Mode::Fault(fault) = record.mode else {
                return None;
            };
            Some((k, fault))
        });
        if let Some((k, fault)) = fault {
            return Err(Error::Fault {
                experiment: if self.excite {
                    "the excitation"
                } else {
                    scenario.name
                },
                time: k as f64 * sample_time,
                number: fault.number(),
                fault: format!("{fault:?}"),
            });
        }
        let state = rig.plant().state();
        let mass = controlled_mass(state.len() / 2 - 1);
        let off = state[2 * mass] - scenario.target;
        // Written so that what is no number has not arrived.
        let arrived = off.abs() <= SETTLING_BAND * scenario.target.abs().max(1e-3);
        if self.excite || arrived {
            return Ok(());
        }
        Err(Error::Simulation(format!(
            "mass {mass} ends {off:.3e} from its target, more than 2 % of the motion"
        )))
    }
}

/// What ends the serial port before its time.
enum Ended {
    Stop(Stop),
    Error(Error),
}

impl From<Stop> for Ended {
    fn from(stop: Stop) -> Self {
        Self::Stop(stop)
    }
}

/// Refuses a firmware that is not the described drive's.
fn require_same_drive(capture: &Capture, drive: &Drive) -> Result<(), Error> {
    let expected = Origin::of(&Design::new(drive)?)?;
    let Some(said) = capture.origins.first() else {
        eprintln!("warning: the firmware does not say which drive it is of");
        return Ok(());
    };
    let differences = said.differences(&expected);
    if differences.is_empty() {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "the firmware is not this drive's: it has {}",
        differences.join(", ")
    )))
}

fn row(name: &str, instructions: f64, cycles: f64) -> String {
    format!("{name:<20} {instructions:>12.1} {cycles:>8.1}\n")
}

/// What a run was, in figures.
fn summary(rig: &Rig, capture: &Capture, periods: &[Period], elapsed: f64) -> Value {
    let cost = rig.board.interrupt_cost();
    let (stack, stack_size) = rig.board.stack_use();
    let simulated = rig.board.bus().now as f64 / rig.board.bus().rcc.processor_hz() as f64;
    let rate = rig.log.len() as f64 / simulated;
    let mean = |sum: u64| sum as f64 / cost.runs.max(1) as f64;
    let (running_instructions, most_running_instructions) = running(periods, |p| p.instructions);
    let (running_cycles, most_running_cycles) = running(periods, |p| p.cycles);
    let state = rig.plant().state();
    json!({
        "control_steps": cost.runs,
        "control_steps_per_second": cost.runs as f64 / elapsed,
        "instructions_mean": mean(cost.instructions),
        "instructions_most": cost.most_instructions,
        "estimated_cycles_mean": mean(cost.cycles),
        "estimated_cycles_most": cost.most_cycles,
        "running_instructions_mean": running_instructions,
        "running_instructions_most": most_running_instructions,
        "running_estimated_cycles_mean": running_cycles,
        "running_estimated_cycles_most": most_running_cycles,
        "preemptions": cost.preemptions,
        "stack_used": stack,
        "stack_size": stack_size,
        "log_bytes_per_second": rate,
        "log_records": capture.records.len(),
        "log_records_lost": capture.lost,
        "log_frames_damaged": capture.malformed,
        "final_positions": state.iter().step_by(2).collect::<Vec<_>>(),
    })
}

/// The same for people.
fn figures(title: &str, summary: &Value, kind: Kind) -> String {
    let number = |name: &str| summary[name].as_f64().unwrap_or(f64::NAN);
    let positions = summary["final_positions"].as_array();
    let positions = positions.into_iter().flatten().filter_map(Value::as_f64);
    let positions: Vec<String> = positions.map(|x| format!("{:.3}", 1e3 * x)).collect();
    format!(
        "{title}\n\
         control steps            {} ({:.0} per second of this machine)\n\
         instructions per step    {:.0} on average, {} at most\n\
         cycles per step          {:.0} on average, {} at most (estimate, see timing.rs)\n\
         stack                    {} of {} bytes used\n\
         log                      {:.0} bytes/s, {} records, {} lost, {} damaged frames\n\
         positions at the end     {} {}\n",
        number("control_steps"),
        number("control_steps_per_second"),
        number("instructions_mean"),
        number("instructions_most"),
        number("estimated_cycles_mean"),
        number("estimated_cycles_most"),
        number("stack_used"),
        number("stack_size"),
        number("log_bytes_per_second"),
        number("log_records"),
        number("log_records_lost"),
        number("log_frames_damaged"),
        positions.join(" "),
        kind.units().milli_position,
    )
}

/// Average and maximum over the periods in which the amplifier was enabled.
fn running(periods: &[Period], value: fn(&Period) -> u64) -> (f64, u64) {
    let enabled = || periods.iter().filter(|period| period.enabled).map(value);
    let mean = enabled().sum::<u64>() as f64 / enabled().count().max(1) as f64;
    (mean, enabled().max().unwrap_or(0))
}

fn table(periods: &[Period], sample_time: f64) -> String {
    let mut text = String::from("time[s],count[1],code[1],enabled[1]\n");
    for (k, period) in periods.iter().enumerate() {
        let time = time(k as f64 * sample_time);
        let code = period.code.map_or(String::new(), |code| code.to_string());
        text += &format!(
            "{time},{},{code},{}\n",
            period.count,
            u8::from(period.enabled)
        );
    }
    text
}
