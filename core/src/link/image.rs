//! A set of settings as bytes: what goes over the link, and what a drive keeps in its flash.
//!
//! ```text
//! header (32) | settings and plans as postcard serialises them | a byte, where that is odd | rows of the plans
//! ```
//!
//! The header is eight words, lowest byte first:
//!
//! | word | |
//! |---|---|
//! | 0 | `ARSO` |
//! | 1 | [`LAYOUT`], form of the observer from bit 16, loads from bit 24 |
//! | 2 | 1 where the drive is rotary |
//! | 3 | serial number, counted up by the drive that keeps it |
//! | 4, 5 | bytes of settings and plans, bytes of the rows |
//! | 6 | CRC-32 (ISO-HDLC) of settings and plans: the fingerprint by which a drive is known |
//! | 7 | CRC-32 (ISO-HDLC) of the words before |
//!
//! Settings and plans say in turn which checksum the rows have. Whoever writes a set into flash writes the header
//! last: a set that was cut off anywhere has none, or one that does not hold. A header of no bytes stands for the settings
//! that are compiled in.

use super::frame::CHECKSUM;
use crate::check::SettingsError;
use crate::moves::plans::{Plan, Plans};
use crate::observer::StateObserver;
use crate::settings::Settings;
use core::fmt;
use heapless::Vec;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Bytes of a header.
pub const HEADER: usize = 32;
/// Version of the serialised form of settings and plans: a new one for every change of their fields.
pub const LAYOUT: u16 = 2;
/// Bytes that a drive keeps a set in.
pub const ROOM: usize = 128 * 1024;
/// Most displacements that a set can have.
pub const DISPLACEMENTS: usize = 128;

const MAGIC: u32 = u32::from_le_bytes(*b"ARSO");

/// What a set is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// See [`StateObserver::FORM`].
    pub form: u8,
    /// Number of load masses.
    pub loads: u8,
    /// Whether the drive is rotary.
    pub rotary: bool,
    /// Of two sets that are kept the one with the larger number is the newer.
    pub serial: u32,
    /// Bytes of settings and plans.
    pub settings: u32,
    /// Bytes of the rows.
    pub rows: u32,
    /// CRC-32 of settings and plans.
    pub fingerprint: u32,
}

/// Why bytes are no set that this drive can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoSet {
    /// There is none.
    Missing,
    /// A checksum does not hold, bytes are missing, or there are too many displacements.
    Damaged,
    /// It was written by a program of another version.
    Layout(u16),
    /// It is for so many loads.
    Loads(u8),
    /// It is for another observer.
    Form,
    /// It cannot be run.
    Settings(SettingsError),
}

impl fmt::Display for NoSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => f.write_str("there are no settings"),
            Self::Damaged => f.write_str("the settings are damaged"),
            Self::Layout(layout) => write!(
                f,
                "the settings have layout {layout}, and this firmware reads layout {LAYOUT}"
            ),
            Self::Loads(loads) => write!(
                f,
                "the settings are for {loads} loads, which this firmware was not built for"
            ),
            Self::Form => f.write_str("the settings are for another observer than this firmware's"),
            Self::Settings(error) => write!(f, "{error}"),
        }
    }
}

impl core::error::Error for NoSet {}

impl From<SettingsError> for NoSet {
    fn from(error: SettingsError) -> Self {
        Self::Settings(error)
    }
}

impl Header {
    /// Its bytes.
    #[must_use]
    pub fn bytes(&self) -> [u8; HEADER] {
        let kinds = u32::from(LAYOUT) | u32::from(self.form) << 16 | u32::from(self.loads) << 24;
        let words = [
            MAGIC,
            kinds,
            self.rotary.into(),
            self.serial,
            self.settings,
            self.rows,
            self.fingerprint,
        ];
        let mut bytes = [0; HEADER];
        for (place, word) in bytes.chunks_exact_mut(4).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        let (said, check) = bytes.split_at_mut(HEADER - 4);
        check.copy_from_slice(&CHECKSUM.checksum(said).to_le_bytes());
        bytes
    }

    /// The header that bytes begin with.
    ///
    /// # Errors
    /// [`NoSet::Missing`], [`NoSet::Damaged`] and [`NoSet::Layout`].
    pub fn of(bytes: &[u8]) -> Result<Self, NoSet> {
        let bytes = bytes.get(..HEADER).ok_or(NoSet::Missing)?;
        let mut words = [0; HEADER / 4];
        for (word, place) in words.iter_mut().zip(bytes.as_chunks::<4>().0) {
            *word = u32::from_le_bytes(*place);
        }
        let [
            magic,
            kinds,
            kind,
            serial,
            settings,
            rows,
            fingerprint,
            check,
        ] = words;
        if magic != MAGIC {
            return Err(NoSet::Missing);
        }
        let said = bytes.get(..HEADER - 4).ok_or(NoSet::Missing)?;
        if CHECKSUM.checksum(said) != check {
            return Err(NoSet::Damaged);
        }
        let [low, high, form, loads] = kinds.to_le_bytes();
        let layout = u16::from_le_bytes([low, high]);
        if layout != LAYOUT {
            return Err(NoSet::Layout(layout));
        }
        Ok(Self {
            form,
            loads,
            rotary: kind == 1,
            serial,
            settings,
            rows,
            fingerprint,
        })
    }

    /// One that stands for the settings that are compiled in.
    #[must_use]
    pub fn of_nothing() -> Self {
        Self {
            form: 0,
            loads: 0,
            rotary: false,
            serial: 0,
            settings: 0,
            rows: 0,
            fingerprint: 0,
        }
    }

    /// Whether it stands for the settings that are compiled in.
    #[must_use]
    pub fn is_of_nothing(&self) -> bool {
        self.settings == 0
    }

    /// `"linear"` or `"rotary"`.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        if self.rotary { "rotary" } else { "linear" }
    }

    /// Where the rows begin, counted from the header on.
    #[must_use]
    pub fn first_row(&self) -> usize {
        (HEADER + self.settings as usize).next_multiple_of(2)
    }

    /// Bytes of the whole set.
    #[must_use]
    pub fn length(&self) -> usize {
        self.first_row().saturating_add(self.rows as usize)
    }

    /// The settings and plans behind this header.
    ///
    /// * `bytes`: of the set; where the header stands is not read
    ///
    /// # Errors
    /// [`NoSet`].
    pub fn settings<const N: usize, O>(&self, bytes: &[u8]) -> Result<Settled<N, O>, NoSet>
    where
        O: StateObserver<N> + DeserializeOwned,
    {
        if usize::from(self.loads) != N {
            return Err(NoSet::Loads(self.loads));
        }
        if self.form != O::FORM {
            return Err(NoSet::Form);
        }
        let end = HEADER.saturating_add(self.settings as usize);
        let said = bytes.get(HEADER..end).ok_or(NoSet::Damaged)?;
        if CHECKSUM.checksum(said) != self.fingerprint {
            return Err(NoSet::Damaged);
        }
        match postcard::take_from_bytes(said) {
            Ok((settled, [])) => Ok(settled),
            _ => Err(NoSet::Damaged),
        }
    }

    /// The rows behind this header, whose checksum holds.
    ///
    /// * `bytes`: of the set, from an even address on
    ///
    /// # Errors
    /// [`NoSet::Damaged`].
    pub fn rows<'b>(&self, bytes: &'b [u8], checksum: u32) -> Result<&'b [i16], NoSet> {
        let rows = bytes.get(self.first_row()..self.length());
        let rows = rows.ok_or(NoSet::Damaged)?;
        if CHECKSUM.checksum(rows) != checksum {
            return Err(NoSet::Damaged);
        }
        bytemuck::try_cast_slice(rows).map_err(|_| NoSet::Damaged)
    }
}

/// Settings, and plans without their rows: the serialised form is that of [`Settings`] and [`Plans`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound(serialize = "O: Serialize", deserialize = "O: DeserializeOwned"))]
pub struct Settled<const N: usize, O> {
    /// The settings.
    pub settings: Settings<N, O>,
    /// The plans.
    pub plans: PlanTable,
}

/// Plans without their rows; the fields are those of [`Plans`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "see Plans")]
pub struct PlanTable {
    pub stride: u16,
    pub displacements: Vec<Plan, DISPLACEMENTS>,
    pub change: Plan,
    pub run: f32,
    pub bend: f32,
    pub checksum: u32,
}

impl PlanTable {
    /// None.
    #[must_use]
    #[expect(clippy::new_without_default, reason = "for a static")]
    pub const fn new() -> Self {
        let change = Plan {
            first: 0,
            knots: 0,
            reach: 0.0,
            feed_forward: 0.0,
            position: 0.0,
            deflection: 0.0,
        };
        Self {
            stride: 0,
            displacements: Vec::new(),
            change,
            run: 0.0,
            bend: 0.0,
            checksum: 0,
        }
    }

    /// With their rows.
    #[must_use]
    pub fn with_rows<'p>(&'p self, rows: &'p [i16]) -> Plans<'p> {
        Plans {
            stride: self.stride,
            displacements: &self.displacements,
            change: self.change,
            run: self.run,
            bend: self.bend,
            rows,
            checksum: self.checksum,
        }
    }

    /// Whether these are the plans that a drive has.
    #[must_use]
    pub fn are(&self, plans: &Plans<'_>) -> bool {
        (self.stride, self.change, self.run, self.bend, self.checksum)
            == (
                plans.stride,
                plans.change,
                plans.run,
                plans.bend,
                plans.checksum,
            )
            && self.displacements == plans.displacements
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::controller::tests::settings;
    use crate::moves::tests::RIGID;
    use crate::observer::{Anchored, Reaction};
    use proptest::prelude::*;
    use std::format;
    use std::string::String;
    use std::vec::Vec as List;

    type Kept = Settled<1, Anchored<1, 5>>;

    /// A set, from an even address on, and what it is made of.
    fn set() -> (List<u16>, Kept, List<i16>) {
        let plans = RIGID;
        let rows = plans.rows.to_vec();
        let plain: List<u8> = rows.iter().flat_map(|word| word.to_le_bytes()).collect();
        let settled = Settled {
            settings: settings(),
            plans: PlanTable {
                stride: plans.stride,
                displacements: Vec::from_slice(plans.displacements).unwrap(),
                change: plans.change,
                run: plans.run,
                bend: plans.bend,
                checksum: CHECKSUM.checksum(&plain),
            },
        };
        let said = postcard::to_allocvec(&settled).unwrap();
        let header = Header {
            form: 0,
            loads: 1,
            rotary: false,
            serial: 7,
            settings: said.len() as u32,
            rows: plain.len() as u32,
            fingerprint: CHECKSUM.checksum(&said),
        };
        let mut bytes = header.bytes().to_vec();
        bytes.extend(said);
        bytes.resize(header.first_row(), 0);
        bytes.extend(plain);
        assert_eq!(bytes.len(), header.length());
        let words = bytes.chunks_exact(2);
        let words = words.map(|pair| u16::from_le_bytes([pair[0], pair[1]]));
        (words.collect(), settled, rows)
    }

    fn read(bytes: &[u8]) -> Result<(Kept, List<i16>), NoSet> {
        let header = Header::of(bytes)?;
        let settled: Kept = header.settings(bytes)?;
        let rows = header.rows(bytes, settled.plans.checksum)?;
        Ok((settled, rows.to_vec()))
    }

    #[test]
    fn a_set_comes_back_as_it_was() {
        let (words, settled, rows) = set();
        let bytes = bytemuck::cast_slice(&words);
        assert_eq!(read(bytes), Ok((settled.clone(), rows.clone())));
        let header = Header::of(bytes).unwrap();
        assert_eq!((header.serial, header.kind()), (7, "linear"));
        // Its serialised form is that of the settings and plans by which a drive is known.
        let plans = settled.plans.with_rows(&rows);
        assert!(settled.plans.are(&plans));
        let known = postcard::to_allocvec(&(&settled.settings, plans)).unwrap();
        assert_eq!(header.fingerprint, CHECKSUM.checksum(&known));
    }

    #[test]
    fn a_set_for_another_drive_is_refused() {
        let (words, ..) = set();
        let bytes: &[u8] = bytemuck::cast_slice(&words);
        let header = Header::of(bytes).unwrap();
        let loads = header.settings::<2, Anchored<2, 7>>(bytes);
        assert_eq!(loads, Err(NoSet::Loads(1)));
        let form = header.settings::<1, Reaction<1, 4>>(bytes);
        assert_eq!(form, Err(NoSet::Form));
        assert_eq!(Header::of(&[0xFF; 64]), Err(NoSet::Missing));
        assert_eq!(Header::of(&[]), Err(NoSet::Missing));
        // Another layout, whose header holds.
        let mut other = bytes[..HEADER].to_vec();
        other[4] = 200;
        let check = CHECKSUM.checksum(&other[..HEADER - 4]);
        other[HEADER - 4..].copy_from_slice(&check.to_le_bytes());
        assert_eq!(Header::of(&other), Err(NoSet::Layout(200)));
    }

    proptest! {
        /// A set that was cut off, or of which bits have changed, is none, and reading it does not panic.
        #[test]
        fn what_is_damaged_is_refused(place in any::<prop::sample::Index>(), mask in 1_u8.., cut: bool) {
            let (mut words, settled, _) = set();
            let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
            let place = place.index(bytes.len());
            if cut {
                bytes[place..].fill(0xFF);
            } else {
                bytes[place] ^= mask;
            }
            let end = Header::of(bytes).map_or(0, |header| HEADER + header.settings as usize);
            let odd = end % 2 == 1 && place == end;
            match read(bytes) {
                // Erased bytes may be what stood there; the byte that fills up says nothing.
                Ok((read, _)) => prop_assert!((cut || odd) && read == settled),
                Err(error) => prop_assert_ne!(error, NoSet::Form),
            }
        }

        #[test]
        fn noise_is_no_set(noise: List<u16>) {
            prop_assert!(read(bytemuck::cast_slice(&noise)).is_err());
        }
    }

    /// Whoever changes the fields of settings or plans changes [`LAYOUT`]: a drive must not read what was meant
    /// otherwise.
    #[test]
    fn the_layout_has_a_version() {
        let (_, settled, _) = set();
        // The names of types and fields.
        let fields: String = format!("{settled:?}")
            .split(|c: char| !(c.is_alphabetic() || c == '_'))
            .filter(|word| word.len() > 1)
            .flat_map(|word| [word, " "])
            .collect();
        // And the numbers as they are written.
        let written = postcard::to_allocvec(&settled.settings).unwrap();
        let sums = [fields.as_bytes(), &written].map(|bytes| CHECKSUM.checksum(bytes));
        assert_eq!((LAYOUT, sums), (2, [1012092893, 785527236]), "{fields}");
    }
}
