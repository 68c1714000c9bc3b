//! The release ELF on the virtual board, in closed loop with the plant of the simulation.
#![cfg(feature = "virtual-board")]

use arso_tests::virtual_board::bus::Patch;
use arso_tests::virtual_board::image::Image;
use arso_tests::virtual_board::rig::{Switches, Wiring};
use arso_tests::virtual_board::{Board, Rig, Stop};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::simulate::scenario::{SCENARIOS, Scenario};
use host_sim::simulate::{Law, simulate};

fn image() -> Image {
    Image::parse(&arso_tests::firmware()).unwrap()
}

fn start(prepare: impl FnOnce(&mut Board)) -> Result<Rig, Stop> {
    let drive = Drive::default_drive();
    Rig::start(&image(), &drive, &PlantFile::from(&drive), prepare)
}

/// The experiments on the ELF and in the simulation: the same encoder count and the same
/// converter code in every period.
///
/// Both run the same `f32` operations in the same order and the same plant in `f64`, so there is
/// nothing to allow for: a single different bit would show as a different code sooner or later.
#[test]
fn every_experiment_is_the_simulations_to_the_last_count() {
    let drive = Drive::default_drive();
    let design = Design::new(&drive).unwrap();
    let plant = PlantFile::from(&drive);
    let mut rig = start(|_| {}).unwrap();
    rig.commission().unwrap();
    let short = Scenario {
        name: "move of 15 mm",
        target: 0.015,
        ..Scenario::PLANNED
    };
    let asked_for = |scenario: &&Scenario| Switches::target_of(scenario).is_some();
    for scenario in SCENARIOS.iter().chain([&short]).filter(asked_for) {
        let board = rig.experiment(scenario, &plant, 1200).unwrap();
        let host = simulate(&design, &plant, scenario, Law::Core, 1.2).unwrap();
        assert_eq!(board.len(), host.samples.len());
        for (k, (board, host)) in board.iter().zip(&host.samples).enumerate() {
            let code = 2048.0 + (host.command / 1e-3).round();
            assert_eq!(
                board.count, host.count,
                "{} count in step {k}",
                scenario.name
            );
            assert_eq!(
                board.code,
                Some(code as u16),
                "{} code in step {k}",
                scenario.name
            );
            assert!(board.enabled);
        }
    }
    let cost = rig.board.interrupt_cost();
    println!("{cost:?}, stack {:?}", rig.board.stack_use());
    assert_eq!(rig.board.bus().tick.lost, 0);
    assert!(rig.board.bus().watchdog.started());
}

/// Whether the loop closes: the drive commissions itself and brings mass 2 to 30 mm.
fn loop_closes(rig: &mut Rig) -> bool {
    let Ok(()) = rig.commission() else {
        return false;
    };
    let plant = PlantFile::from(&Drive::default_drive());
    let Ok(_) = rig.experiment(Scenario::named("fig3").unwrap(), &plant, 500) else {
        return false;
    };
    (rig.plant().state()[4] - 0.03).abs() < 0.6e-3
}

/// One register write changed, one peripheral set up wrongly, and the loop does not close.
#[test]
fn wrong_hardware_set_up_shows() {
    assert!(loop_closes(&mut start(|_| {}).unwrap()));
    for (what, address, mask, value) in [
        ("encoder pins are inputs", 0x4002_0800_u32, 0b1111 << 12, 0),
        (
            "encoder pins of another timer",
            0x4002_0820,
            0xFF << 24,
            0x33 << 24,
        ),
        ("encoder timer is not enabled", 0x4000_0400, 1, 0),
        (
            "encoder timer is not in encoder mode",
            0x4000_0408,
            0b111,
            0,
        ),
        (
            "encoder timer has no inputs selected",
            0x4000_0418,
            0x0303,
            0,
        ),
        ("encoder timer has no clock", 0x4002_3840, 1 << 1, 0),
        ("control timer is not enabled", 0x4000_0000, 1, 0),
        ("control timer gives no interrupt", 0x4000_000C, 1, 0),
        ("control timer has no clock", 0x4002_3840, 1, 0),
        (
            "control timer's prescaler is wrong",
            0x4000_0028,
            0xFFFF,
            839,
        ),
        (
            "control timer's period is wrong",
            0x4000_002C,
            u32::MAX,
            9_999,
        ),
        ("converter is not enabled", 0x4000_7400, 1, 0),
        ("converter has no clock", 0x4002_3840, 1 << 29, 0),
        ("converter's pin is digital", 0x4002_0000, 0b11 << 8, 0),
        ("enable pin is an input", 0x4002_0400, 0b11 << 24, 0),
        (
            "port of the enable pin has no clock",
            0x4002_3830,
            1 << 1,
            0,
        ),
        ("switches' port has no clock", 0x4002_3830, 1 << 2, 0),
        ("processor is not switched to the PLL", 0x4002_3808, 0b11, 0),
        ("interrupt is not enabled", 0xE000_E100, 1 << 28, 0),
    ] {
        let patch = Patch {
            address,
            mask,
            value,
        };
        let rig = start(|board| board.bus_mut().patch = Some(patch));
        let stopped = match rig {
            Err(stop) => {
                println!("{what}: {stop}");
                true
            }
            Ok(mut rig) => {
                let closed = loop_closes(&mut rig);
                assert!(
                    rig.board.bus().patched > 0,
                    "{what}: the firmware never writes there"
                );
                println!(
                    "{what}: {}",
                    if closed { "closes" } else { "does not close" }
                );
                !closed
            }
        };
        assert!(stopped, "{what}: not noticed");
    }
}

/// Wiring faults are found by the commissioning motion, before the loop is closed.
#[test]
fn wrong_wiring_stops_the_drive() {
    let wirings = [
        (
            "phases swapped",
            Wiring {
                phases_swapped: true,
                ..Wiring::default()
            },
        ),
        (
            "motor reversed",
            Wiring {
                motor_reversed: true,
                ..Wiring::default()
            },
        ),
        (
            "encoder unplugged",
            Wiring {
                encoder_unplugged: true,
                ..Wiring::default()
            },
        ),
    ];
    for (what, wiring) in wirings {
        let mut rig = start(|_| {}).unwrap();
        rig.wiring = wiring;
        rig.periods(50).unwrap();
        rig.switches(Switches::run(1));
        let periods = rig.periods(3000).unwrap();
        assert!(periods.iter().any(|period| period.enabled), "{what}");
        assert!(!periods.last().unwrap().enabled, "{what}");
        let enabled = periods.iter().filter(|period| period.enabled).count();
        println!("{what}: enabled for {enabled} ms");
        assert!(enabled <= 502, "{what}");
        if !wiring.encoder_unplugged {
            // Found after 200 counts, at a quarter of the current.
            assert!(enabled < 50, "{what}");
            let codes = periods.iter().filter_map(|period| period.code);
            assert!(
                codes.clone().all(|code| code.abs_diff(2048) < 500),
                "{what}"
            );
        }
    }
}

/// No current before anything is asked, and none after the run switch is opened.
#[test]
fn the_amplifier_is_off_unless_asked() {
    let mut rig = start(|_| {}).unwrap();
    let idle = rig.periods(200).unwrap();
    assert!(
        idle.iter()
            .all(|period| !period.enabled && period.code == Some(2048))
    );
    rig.commission().unwrap();
    rig.switches(Switches::run(1));
    rig.periods(100).unwrap();
    rig.switches(Switches::default());
    let stopped = rig.periods(30).unwrap();
    assert!(!stopped.last().unwrap().enabled);
    assert_eq!(stopped.last().unwrap().code, Some(2048));
}

/// A fault of the processor in the midst of a motion: the firmware's handler switches the amplifier
/// off within some instructions and halts, until the watchdog resets it.
#[test]
fn a_processor_fault_switches_the_amplifier_off() {
    let mut rig = start(|_| {}).unwrap();
    rig.commission().unwrap();
    rig.switches(Switches::run(1));
    let moving = rig.periods(40).unwrap().pop().unwrap();
    assert!(moving.enabled && moving.code != Some(2048));
    let before = rig.board.instructions();
    rig.board.hard_fault();
    let stop = rig.board.run_to_tick().unwrap_err();
    assert!(matches!(stop, Stop::Halted { .. }), "{stop}");
    assert!(rig.board.instructions() - before < 100);
    assert!(!rig.board.bus().ports[1].drives_high(12));
    assert_eq!(rig.board.bus().current_reference(), Some(2048));
    assert!(rig.board.bus().watchdog.expires().is_some());
}

/// An access that no model knows names address and program counter.
#[test]
fn unknown_registers_are_errors() {
    // The vector of reset points at a tiny program: ldr r0, [pc, #4]; ldr r1, [r0]; b .
    let mut image = image();
    let code: [u16; 6] = [0x4801, 0x6801, 0xE7FE, 0xBF00, 0x0000, 0x4001];
    let at = 0x400;
    for (i, half) in code.iter().enumerate() {
        image.flash[at + 2 * i..at + 2 * i + 2].copy_from_slice(&half.to_le_bytes());
    }
    image.flash[4..8].copy_from_slice(&(0x0800_0401_u32).to_le_bytes());
    let stop = Board::new(&image).run_to_tick().unwrap_err();
    assert_eq!(
        stop,
        Stop::UnknownRegister {
            address: 0x4001_0000,
            written: None,
            pc: 0x0800_0402
        }
    );
    assert_eq!(
        stop.to_string(),
        "read of the unknown register 0x40010000 at pc 0x08000402"
    );
}

/// Interrupts so fast that they come in the midst of the idle loop's work: every register, floating
/// point included, is the same after each as before (the board compares them), and the log stays
/// whole.
#[test]
fn registers_survive_preemption() {
    let fast = Patch {
        address: 0x4000_002C,
        mask: u32::MAX,
        value: 18,
    };
    let mut board = Board::new(&image());
    board.bus_mut().patch = Some(fast);
    for _ in 0..20_000 {
        board.run_to_tick().unwrap();
    }
    let cost = board.interrupt_cost();
    println!("{cost:?}");
    assert!(cost.preemptions > 10_000, "{cost:?}");
}
