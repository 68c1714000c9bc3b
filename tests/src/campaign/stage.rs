//! The stage: the drive commissioned once, and a snapshot of the rig at each instant.

use crate::virtual_board::image::{FLASH, Image};
use crate::virtual_board::rig::{Snapshot, Switches};
use crate::virtual_board::{Rig, Stop, cpu};
use host_sim::drive::{Drive, PlantFile};

/// Target of the motion, m, and the switches that ask for it.
pub const TARGET: f64 = 0.03;
const SWITCHES: u32 = 1;
/// Periods after the run switch is closed within which the drive must move.
const STARTS: u32 = 50;
/// The motion, from its first period, and when it is at rest.
const MOTION: u32 = 180;
const REST: u32 = 700;
/// Periods between two instants at rest.
const BETWEEN: u32 = 7;

/// An instant at which a fault begins.
pub struct Instant {
    /// Whether the machine is in motion.
    pub moving: bool,
    /// Control period of the motion.
    pub period: u32,
    /// The rig.
    pub rig: Snapshot,
}

/// Everything that a run begins with.
pub struct Stage {
    /// The firmware, with [`Stage::trap`] in flash that it does not use.
    pub image: Image,
    /// Its ELF.
    pub elf: Vec<u8>,
    /// The drive it was built for.
    pub drive: Drive,
    /// Address of an instruction that jumps to itself.
    pub trap: u32,
    /// The board just reset.
    pub fresh: cpu::Snapshot,
    /// First those in motion, then those at rest.
    pub instants: Vec<Instant>,
}

impl Stage {
    /// Commissions the drive and takes it through the motion.
    ///
    /// * `count`: instants in motion, and as many at rest
    ///
    /// # Errors
    /// One sentence: no firmware for this board, or whatever stops it.
    pub fn set(elf: Vec<u8>, drive: Drive, count: u32) -> Result<Self, String> {
        let mut image = Image::parse(&elf)?;
        let trap = lay_trap(&mut image);
        let stopped = |stop: Stop| stop.to_string();
        let plant = PlantFile::from(&drive);
        let mut rig = Rig::start(&image, &drive, &plant, |_| {}).map_err(stopped)?;
        let fresh = rig.board.snapshot();
        rig.commission().map_err(stopped)?;
        rig.change_plant(&plant, 1, false);
        rig.switches(Switches::run(SWITCHES));
        let mut waited = 0;
        while !rig.period().map_err(stopped)?.enabled {
            waited += 1;
            if waited > STARTS {
                return Err(Stop::NotCommissioned.to_string());
            }
        }
        let moving = (0..count).map(|i| (true, (2 * i + 1) * MOTION / (2 * count)));
        let resting = (0..count).map(|i| (false, REST + BETWEEN * i));
        let mut instants = Vec::new();
        let mut now = 0;
        for (moving, period) in moving.chain(resting) {
            rig.periods(period - now).map_err(stopped)?;
            now = period;
            let rig = rig.snapshot();
            instants.push(Instant {
                moving,
                period,
                rig,
            });
        }
        Ok(Self {
            image,
            elf,
            drive,
            trap,
            fresh,
            instants,
        })
    }

    /// A rig for one worker.
    ///
    /// # Errors
    /// Whatever stops the firmware.
    pub fn rig(&self) -> Result<Rig, Stop> {
        Rig::start(&self.image, &self.drive, &self.machine(), |_| {})
    }

    /// The machine as the drive knows it.
    #[must_use]
    pub fn machine(&self) -> PlantFile {
        PlantFile::from(&self.drive)
    }
}

/// Puts `b .` behind what the firmware uses of its flash, followed by nothing; returns its address.
fn lay_trap(image: &mut Image) -> u32 {
    let end = image.flash.iter().rposition(|byte| *byte != 0xFF);
    let place = (end.map_or(0, |end| end + 1)).next_multiple_of(4);
    if let Some(free) = image.flash.get_mut(place..place + 2) {
        free.copy_from_slice(&0xE7FE_u16.to_le_bytes());
    }
    FLASH + place as u32
}
