//! Drives of the tests, and their translation for the reference implementation.

use crate::reference::{ReferenceDrive, ReferenceGains, ReferenceObserver};
use host_sim::design::Design;
use host_sim::drive::{Drive, Observer, Weights};
use host_sim::machine::Load;

/// The default drive with its last load repeated or removed until there are `loads` of them.
#[must_use]
pub fn drive_with_loads(loads: usize) -> Drive {
    let mut drive = Drive::default_drive();
    let load = drive.loads[0].clone();
    drive.loads.resize(loads, load);
    drive.cost.weights = Weights::Given {
        position: vec![225.0; loads + 1],
        velocity: vec![0.2; loads + 1],
    };
    drive
}

/// A belt axis of 5 A: another machine, encoder and amplifier than the default drive's.
///
/// # Panics
/// Where its file cannot be read.
#[must_use]
pub fn belt() -> Drive {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/belt-drive.toml");
    Drive::load(Some(file.as_ref())).unwrap()
}

/// Drives that differ from the default in every way the core knows of.
#[must_use]
pub fn drives() -> Vec<(String, Drive)> {
    let mut drives = Vec::new();
    for loads in 1..=6 {
        drives.push((format!("{loads} loads"), drive_with_loads(loads)));
    }
    let mut reaction = Drive::default_drive();
    reaction.control.observer = Observer::Reaction;
    drives.push(("reaction".into(), reaction));

    let mut deviating = Drive::default_drive();
    deviating.actuator.mass_deviation = 0.004;
    deviating.actuator.force_constant_deviation = -0.3;
    drives.push(("identified deviations".into(), deviating));

    let mut uneven = Drive::default_drive();
    uneven.encoder.counter_bits = 32;
    uneven.encoder.resolution = 0.5e-6;
    uneven.actuator.current_resolution = 0.0;
    uneven.control.disturbance_cutoff = 900.0;
    uneven.control.reaction_force_cutoff = 400.0;
    uneven.loads = vec![
        Load {
            mass: 0.03,
            stiffness: 500.0,
            damping: 0.4,
            ..Load::default()
        },
        Load {
            mass: 0.01,
            stiffness: 150.0,
            damping: 0.02,
            ..Load::default()
        },
        Load {
            mass: 0.05,
            stiffness: 900.0,
            damping: 0.3,
            ..Load::default()
        },
    ];
    drives.push(("uneven chain, unequal cutoffs".into(), uneven));
    drives
}

/// The same drive, gains and observer for the reference implementation.
#[must_use]
pub fn reference(design: &Design) -> (ReferenceDrive, ReferenceGains, ReferenceObserver) {
    let drive = &design.drive;
    let of_loads = |value: fn(&Load) -> f64| drive.loads.iter().map(value).collect();
    let reference_drive = ReferenceDrive {
        actuator_mass: drive.actuator.mass,
        force_constant: drive.actuator.force_constant,
        mass_deviation: drive.actuator.mass_deviation,
        force_constant_deviation: drive.actuator.force_constant_deviation,
        current_limit: drive.actuator.current_limit,
        current_resolution: drive.actuator.current_resolution,
        encoder_resolution: drive.encoder.resolution,
        counter_bits: drive.encoder.counter_bits,
        load_mass: of_loads(|load| load.mass),
        stiffness: of_loads(|load| load.stiffness),
        damping: of_loads(|load| load.damping),
        sample_time: drive.control.sample_time,
        disturbance_cutoff: drive.control.disturbance_cutoff,
        reaction_force_cutoff: drive.control.reaction_force_cutoff,
    };
    let gains = ReferenceGains {
        regulator: design.regulator.iter().copied().collect(),
        observer_gain: design.observer.correction.iter().copied().collect(),
    };
    let observer = match drive.control.observer {
        Observer::Anchored => ReferenceObserver::Anchored,
        Observer::Reaction => ReferenceObserver::Reaction,
    };
    (reference_drive, gains, observer)
}
