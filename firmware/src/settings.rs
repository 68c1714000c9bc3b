//! Which settings the drive runs with, and whether a board can run them.
//!
//! ```text
//! flash, two slots --choose--> the newer set that can be run --> Set --> controller, log, link
//! compiled in --------------> where there is none
//! ```
//!
//! [`GAINS`] and [`PLANS`] are written by `host-sim design --rust`, and the profile to be played by
//! `host-sim excite --rust`, for the same drive: it is played with the settings compiled in alone. The number of
//! loads and the form of the observer are the firmware's.

use crate::board::{Capabilities, Slot, Storage};
use arso_core::link::frame::CHECKSUM;
use arso_core::link::image::{Header, NoSet, PlanTable, Settled};
use arso_core::link::message::Source;
use arso_core::moves::plans::Plans;
use arso_core::observer::StateObserver;
use arso_core::{Excitation, Settings};
use core::fmt;
use crc::Digest;
use postcard::ser_flavors::Flavor;

use crate::excitation::{EXCITATION, SAMPLE_TIME};
use crate::gains::{GAINS, KIND, PLANS};
pub use crate::gains::{LOADS, Observer};

/// The settings of this firmware's drives.
pub type DriveSettings = Settings<LOADS, Observer>;

const _: () = assert!(
    SAMPLE_TIME == GAINS.sample_time,
    "excitation and gains are made for different control periods"
);

/// What a board cannot do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Misfit(&'static str);

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

/// Why a set is not run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unfit {
    /// It is none.
    NoSet(NoSet),
    /// It is none for this board.
    Board(Misfit),
}

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSet(error) => error.fmt(f),
            Self::Board(error) => error.fmt(f),
        }
    }
}

impl From<NoSet> for Unfit {
    fn from(error: NoSet) -> Self {
        Self::NoSet(error)
    }
}

/// The control period of settings, µs.
#[must_use]
pub const fn period_us(settings: &DriveSettings) -> u32 {
    (settings.sample_time * 1e6 + 0.5) as u32
}

/// Holds settings against what a board can do.
///
/// # Errors
/// [`Misfit`] where it cannot do what they ask.
pub const fn fit(settings: &DriveSettings, board: &Capabilities) -> Result<(), Misfit> {
    let Settings {
        amplifier,
        limits,
        encoder,
        ..
    } = settings;
    let period = period_us(settings);
    let error = settings.sample_time * 1e6 - period as f32;
    // f32 holds the period to seven figures.
    let tolerance = 1e-6 * period as f32;
    let (shortest, longest) = board.periods;
    let conditions = [
        (
            amplifier.step > 0.0 && amplifier.step == limits.current_resolution,
            "current_resolution must be what one code of the converter means to the amplifier",
        ),
        (
            encoder.counter_bits == board.counter_bits,
            "counter_bits must be the width of the board's counter",
        ),
        (
            limits.current_limit <= amplifier.reach(board.converter_codes),
            "current_limit is beyond what the converter's codes reach on both sides of zero_code",
        ),
        (
            // The last moves are kept in steps of the converter, 32767 either way.
            board.converter_codes <= 32_768,
            "the board's converter has more codes than the last moves can be kept in",
        ),
        (
            error < tolerance && error > -tolerance,
            "sample_time must be a whole number of microseconds",
        ),
        (
            period >= shortest && period <= longest,
            "sample_time is outside what the board's timer can do",
        ),
    ];
    let mut i = 0;
    while i < conditions.len() {
        let (holds, sentence) = conditions[i];
        if !holds {
            return Err(Misfit(sentence));
        }
        i += 1;
    }
    Ok(())
}

/// Holds what is compiled in against what a board can do, at compile time.
///
/// # Panics
/// Where it does not fit, which then does not compile.
pub const fn require_fit(board: &Capabilities) {
    if let Err(Misfit(sentence)) = fit(&GAINS, board) {
        panic!("{}", sentence);
    }
}

/// The settings that the drive runs with.
#[derive(Clone, Debug)]
pub struct Set {
    /// They.
    pub settings: DriveSettings,
    /// The plans.
    pub plans: Plans<'static>,
    /// What it can play.
    pub excitation: Option<Excitation>,
    /// Where they are from.
    pub source: Source,
    /// Header of the set, as if it were sent.
    pub header: Header,
}

impl Set {
    fn compiled_in(source: Source) -> Self {
        let (settings, fingerprint) = said(&GAINS, PLANS);
        Self {
            settings: GAINS,
            plans: PLANS,
            excitation: Some(EXCITATION),
            source,
            header: Header {
                form: <Observer as StateObserver<LOADS>>::FORM,
                loads: LOADS as u8,
                // Both are names that the design writes.
                rotary: matches!(KIND.as_bytes(), b"rotary"),
                serial: 0,
                settings,
                rows: size_of_val(PLANS.rows) as u32,
                fingerprint,
            },
        }
    }

    /// The drive goes on with other settings.
    pub(crate) fn change(&mut self, settings: DriveSettings) {
        let (length, fingerprint) = said(&settings, self.plans);
        self.settings = settings;
        self.source = Source::Changed;
        self.excitation = None;
        self.header.settings = length;
        self.header.fingerprint = fingerprint;
    }

    /// Some bytes of the serialised form, from a place on.
    pub(crate) fn copy(&self, from: usize, to: &mut [u8]) -> usize {
        let part = Part {
            to,
            skipped: from,
            used: 0,
        };
        postcard::serialize_with_flavor(&(&self.settings, self.plans), part).unwrap_or(0)
    }
}

/// Length and checksum of settings and plans in their serialised form, which is never there as a whole.
pub(crate) fn said(settings: &DriveSettings, plans: Plans<'_>) -> (u32, u32) {
    struct Passing(u32, Digest<'static, u32>);
    impl Flavor for Passing {
        type Output = (u32, u32);
        // Some hundred places push.
        #[inline(never)]
        fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
            self.0 += 1;
            self.1.update(&[byte]);
            Ok(())
        }
        fn finalize(self) -> postcard::Result<(u32, u32)> {
            Ok((self.0, self.1.finalize()))
        }
    }
    let passing = Passing(0, CHECKSUM.digest());
    // Nothing in it can fail: settings are numbers.
    postcard::serialize_with_flavor(&(settings, plans), passing).unwrap_or((0, 0))
}

/// Part of a serialised form.
struct Part<'a> {
    to: &'a mut [u8],
    skipped: usize,
    used: usize,
}

impl Flavor for Part<'_> {
    type Output = usize;

    #[inline(never)]
    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        if self.skipped > 0 {
            self.skipped -= 1;
        } else if let Some(place) = self.to.get_mut(self.used) {
            *place = byte;
            self.used += 1;
        }
        Ok(())
    }

    fn finalize(self) -> postcard::Result<usize> {
        Ok(self.used)
    }
}

/// Reads a set and holds it against the board.
///
/// * `header`: of it, whatever stands in front of `bytes`
///
/// # Errors
/// [`Unfit`] where it cannot be run.
pub(crate) fn read<'b>(
    header: &Header,
    bytes: &'b [u8],
    board: &Capabilities,
) -> Result<(Settled<LOADS, Observer>, &'b [i16]), Unfit> {
    let settled: Settled<LOADS, Observer> = header.settings(bytes)?;
    settled.settings.check().map_err(NoSet::from)?;
    fit(&settled.settings, board).map_err(Unfit::Board)?;
    let rows = header.rows(bytes, settled.plans.checksum)?;
    let plans = settled.plans.with_rows(rows);
    plans.check(LOADS).map_err(NoSet::from)?;
    Ok((settled, rows))
}

/// What is kept.
pub struct Kept<S> {
    /// The slot that may be written.
    pub spare: S,
    /// Largest serial number in either slot.
    pub newest: u32,
}

/// The newer of the sets that are kept, of those that can be run, or what is compiled in.
///
/// * `table`: where the plans of the set lie from then on, but for their rows, which are read where they are kept
pub fn choose<S: Storage>(
    storage: S,
    table: &'static mut PlanTable,
    board: &Capabilities,
) -> (Set, Kept<S::Spare>) {
    let mut best: Option<(Slot, Header, Option<Settled<LOADS, Observer>>)> = None;
    let (mut newest, mut source) = (0, Source::CompiledIn);
    for slot in [Slot::First, Slot::Second] {
        let bytes = storage.read(slot);
        let of = |header: Header| {
            newest = header.serial.max(newest);
            let settled = if header.is_of_nothing() {
                None
            } else {
                Some(read(&header, bytes, board)?.0)
            };
            Ok((header, settled))
        };
        match Header::of(bytes).map_err(Unfit::from).and_then(of) {
            // Nothing was ever kept there.
            Err(Unfit::NoSet(NoSet::Missing)) => {}
            Ok((header, settled)) => {
                let newer = best
                    .as_ref()
                    .is_none_or(|(_, best, _)| header.serial >= best.serial);
                if newer {
                    best = Some((slot, header, settled));
                }
            }
            Err(error) => {
                source = Source::Fallback;
                defmt::warn!(
                    "settings of slot {}: {}",
                    slot,
                    defmt::Display2Format(&error)
                );
            }
        }
    }
    let used = best.as_ref().map(|(slot, ..)| *slot);
    let (bytes, spare) = storage.divide(used);
    let kept = Kept { spare, newest };
    let (header, settled) = match best {
        Some((_, header, Some(settled))) => (header, settled),
        // Those that are kept were put away.
        Some((_, _, None)) => return (Set::compiled_in(Source::CompiledIn), kept),
        None => return (Set::compiled_in(source), kept),
    };
    *table = settled.plans;
    let rows = header.rows(bytes, table.checksum).unwrap_or_default();
    let own = header.fingerprint == said(&GAINS, PLANS).1;
    let set = Set {
        settings: settled.settings,
        plans: table.with_rows(rows),
        excitation: own.then_some(EXCITATION),
        source: Source::Kept(header.serial),
        header,
    };
    (set, kept)
}
