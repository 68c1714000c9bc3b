//! The control core behind one interface, whatever the number of loads and the observer.
//!
//! The core is generic over sizes that a drive file chooses at run time; here each combination
//! is instantiated once and hidden behind [`Corridor`]. What runs is the core of the firmware,
//! `f32` and all.

use crate::design::plans::{CHECKSUM, PlanTable};
use crate::design::protection::Protection;
use crate::design::{Design, gains_file::gains_file};
use crate::drive::{MAX_LOADS, Observer};
use crate::error::{self, Error};
use crate::machine::Kind;
use arso_core::link::image::{DISPLACEMENTS, Header, NoSet, ROOM, Settled};
use arso_core::observer::{Anchored, LinearObserver, Reaction, StateObserver};
use arso_core::{
    Command, Controller, Excitation, Measurement, Mode, Refusal, Request, SettingsError, Telemetry,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Widths of the counters that boards have, bits.
const BOARD_COUNTERS: [u32; 2] = [16, 32];

/// A control core of any size.
pub trait Corridor {
    /// See [`Controller::request`].
    ///
    /// # Errors
    /// The drive's refusal.
    fn request(&mut self, request: Request) -> Result<(), Refusal>;
    /// See [`Controller::step`].
    fn step(&mut self, measurement: Measurement) -> Command;
    /// What the last period found.
    fn record(&self) -> Record;
    /// The part of it that figures are made of, lent.
    fn found(&self) -> Found<'_>;
}

/// A telemetry record of any size.
pub type Record = Telemetry<Vec<f32>>;

/// What a period found, without a copy.
#[derive(Clone, Copy, Debug)]
pub struct Found<'c> {
    /// What the drive does after it.
    pub mode: Mode,
    /// Reference position, m.
    pub reference: f32,
    /// Estimated position of the actuator, m.
    pub position: f32,
    /// Of each load, m.
    pub load_position: &'c [f32],
}

impl<'c> Found<'c> {
    /// What a record says.
    pub fn of<L: AsRef<[f32]>>(record: &'c Telemetry<L>) -> Self {
        Self {
            mode: record.mode,
            reference: record.reference,
            position: record.position,
            load_position: record.load_position.as_ref(),
        }
    }

    /// Estimated positions `x_a x_1 …`, m.
    pub fn positions(&self) -> impl Iterator<Item = f64> {
        let all = std::iter::once(&self.position).chain(self.load_position);
        all.map(|position| f64::from(*position))
    }
}

impl<const N: usize, O: StateObserver<N> + Clone> Corridor for Controller<'_, N, O> {
    fn request(&mut self, request: Request) -> Result<(), Refusal> {
        Controller::request(self, request)
    }

    fn step(&mut self, measurement: Measurement) -> Command {
        Controller::step(self, measurement)
    }

    fn record(&self) -> Record {
        self.telemetry().map(|loads| loads.to_vec())
    }

    fn found(&self) -> Found<'_> {
        Found::of(self.telemetry())
    }
}

/// Hands the core's observers, with their numbers of loads and states, to a macro behind its arguments.
macro_rules! with_observers {
    ($then:ident! $arguments:tt) => {
        $then! { $arguments
            Anchored: 1 5, 2 7, 3 9, 4 11, 5 13, 6 15;
            Reaction: 1 4, 2 6, 3 8, 4 10, 5 12, 6 14;
        }
    };
}

/// Calls `$function::<N, S, O>($design, O::new, "O", …)` with the core's observer of a design and its
/// sizes.
macro_rules! with_sizes {
    ($function:ident($design:expr $(, $argument:expr)*)) => {
        with_observers!(by_design! ($function, $design, ($($argument),*)))
    };
}

macro_rules! by_design {
    (($function:ident, $design:expr, $arguments:tt)
     $($observer:ident: $($loads:literal $states:literal),+;)+) => {
        match ($design.drive.control.observer, $design.loads()) {
            $($((Observer::$observer, $loads) => by_design!(
                @ $function::<$loads, $states, _>, $design, $observer, $arguments
            ),)+)+
            (_, loads) => unreachable!("a drive has 1 to {MAX_LOADS} loads, not {loads}"),
        }
    };
    (@ $function:path, $design:expr, $observer:ident, ($($argument:expr),*)) => {
        $function($design, $observer::new, stringify!($observer) $(, $argument)*)
    };
}

/// The core with a design's gains and plans, and what it can play.
///
/// # Errors
/// [`Error::Design`] when the core refuses the settings, or there are no plans.
pub fn corridor(
    design: &Design,
    excitation: Option<Excitation>,
) -> error::Result<Box<dyn Corridor + '_>> {
    let protection = design.protection();
    corridor_with(design, design.plans()?, &protection, excitation)
}

/// The same with plans of another design for the same machine, and with limits of its own.
///
/// # Errors
/// [`Error::Design`] when the core refuses the settings.
pub(crate) fn corridor_with<'d>(
    design: &Design,
    plans: &'d PlanTable,
    protection: &Protection,
    excitation: Option<Excitation>,
) -> error::Result<Box<dyn Corridor + 'd>> {
    fn build<'d, const N: usize, const S: usize, O: StateObserver<N> + Clone + 'd>(
        design: &Design,
        observer: impl FnOnce(LinearObserver<S>) -> O,
        _: &str,
        plans: &'d PlanTable,
        protection: &Protection,
        excitation: Option<Excitation>,
    ) -> error::Result<Box<dyn Corridor + 'd>> {
        let unfit = |error: SettingsError| Error::Design(error.to_string());
        let settings = design.settings(observer, protection);
        let controller = Controller::new(&settings, plans.plans()).map_err(unfit)?;
        Ok(match excitation {
            Some(excitation) => Box::new(controller.with_excitation(excitation)),
            None => Box::new(controller),
        })
    }
    with_sizes!(build(design, plans, protection, excitation))
}

/// The gains file for the firmware; `origin` says where the drive was described.
///
/// # Errors
/// [`Error::Design`] when there are no plans, or for a counter that no board has.
pub fn gains_source(design: &Design, origin: &str) -> error::Result<String> {
    let bits = design.drive.encoder.counter_bits;
    if !BOARD_COUNTERS.contains(&bits) {
        return Err(Error::Design(format!(
            "encoder.counter_bits = {bits}: the firmware reads counters of 16 or 32 bits alone, so there are no \
             gains of this drive for it"
        )));
    }
    let plans = design.plans()?;
    Ok(with_sizes!(gains_file(design, origin, plans)))
}

/// Checksum of a design's settings in their serialised form: what the firmware says of itself in its log.
///
/// # Errors
/// [`Error::Report`] when they cannot be serialised.
pub fn fingerprint(design: &Design) -> error::Result<u32> {
    Ok(CHECKSUM.checksum(&said(design)?.1))
}

/// A design's settings and plans as a set, as a drive takes it over its link and keeps it (see
/// [`image`](arso_core::link::image)).
///
/// # Errors
/// [`Error::Design`] when there are no plans, or more than a set can have; [`Error::Report`] when they cannot be
/// serialised.
pub fn settings_image(design: &Design) -> error::Result<Vec<u8>> {
    let plans = design.plans()?.plans();
    let displacements = plans.displacements.len();
    if displacements > DISPLACEMENTS {
        return Err(Error::Design(format!(
            "{displacements} planned displacements are more than the {DISPLACEMENTS} that a drive keeps: \
             reduce `motion.table`"
        )));
    }
    let (form, settings) = said(design)?;
    let rows: Vec<u8> = plans
        .rows
        .iter()
        .flat_map(|word| word.to_le_bytes())
        .collect();
    let header = Header {
        form,
        loads: design.loads() as u8,
        rotary: design.drive.kind == Kind::Rotary,
        // The drive's own affair.
        serial: 0,
        settings: settings.len() as u32,
        rows: rows.len() as u32,
        fingerprint: CHECKSUM.checksum(&settings),
    };
    if header.length() > ROOM {
        return Err(Error::Design(format!(
            "the planned moves take {} bytes, and a drive keeps {ROOM} with all its settings: reduce `motion.table`",
            rows.len()
        )));
    }
    let mut image = header.bytes().to_vec();
    image.extend(settings);
    image.resize(header.first_row(), 0);
    image.extend(rows);
    Ok(image)
}

/// Form of the observer, and settings and plans in their serialised form.
fn said(design: &Design) -> error::Result<(u8, Vec<u8>)> {
    fn of<const N: usize, const S: usize, O: StateObserver<N> + Serialize>(
        design: &Design,
        observer: impl FnOnce(LinearObserver<S>) -> O,
        _: &str,
    ) -> error::Result<(u8, Vec<u8>)> {
        let failed = |error| Error::Report(format!("the settings cannot be serialised: {error}"));
        let all = (
            design.settings::<N, S, O>(observer, &design.protection()),
            design.plans()?.plans(),
        );
        Ok((O::FORM, postcard::to_allocvec(&all).map_err(failed)?))
    }
    with_sizes!(of(design))
}

/// Settings and plans, as a drive says them, but for the rows of the plans.
///
/// * `bytes`: of the set, header first
///
/// # Errors
/// [`Error::Link`] for what is no such set.
pub fn settings_said(header: &Header, bytes: &[u8]) -> error::Result<serde_json::Value> {
    fn of<const N: usize, O: StateObserver<N> + Serialize + DeserializeOwned>(
        header: &Header,
        bytes: &[u8],
    ) -> Result<serde_json::Value, String> {
        let said: Settled<N, O> = header.settings(bytes).map_err(|error| error.to_string())?;
        // With the numbers that were meant: 0.03 and not 0.029999999.
        let text = serde_json::to_string(&said).and_then(|text| serde_json::from_str(&text));
        text.map_err(|error| error.to_string())
    }
    macro_rules! by_form {
        (($header:expr, $bytes:expr)
         $($observer:ident: $($loads:literal $states:literal),+;)+) => {
            match ($header.form, $header.loads) {
                $($((<$observer<$loads, $states> as StateObserver<$loads>>::FORM, $loads) => {
                    of::<$loads, $observer<$loads, $states>>($header, $bytes)
                })+)+
                (_, loads) => Err(NoSet::Loads(loads).to_string()),
            }
        };
    }
    let said = with_observers!(by_form!(header, bytes));
    said.map_err(|error| Error::Link(format!("the settings of the drive cannot be read: {error}")))
}
