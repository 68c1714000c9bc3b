//! Gains of the drive. GENERATED from embedded drive.toml; do not edit.
//!
//! `cargo run --release -- design [DRIVE.toml] --rust firmware/src/gains.rs`

use arso_core::Settings;
use arso_core::actuator::Actuator;
use arso_core::amplifier::Amplifier;
use arso_core::encoder::Encoder;
use arso_core::limits::Limits;
use arso_core::moves::rigid::MotionLimits;
use arso_core::observer::{Anchored, LinearObserver};
use arso_core::protection::ProtectionLimits;
use arso_core::regulator::{MassGain, Regulator};

/// Linear or rotary: which units all numbers are in.
pub const KIND: &str = "linear";

/// Number of load masses.
pub const LOADS: usize = 3;

/// The state observer, with its number of states.
pub type Observer = Anchored<LOADS, 9>;

/// All that the core knows of the drive.
#[rustfmt::skip]
pub const GAINS: Settings<LOADS, Observer> = Settings {
    sample_time: 0.001, // s
    encoder: Encoder { resolution: 1e-6, counter_bits: 16 }, // m
    actuator: Actuator {
        mass: 0.059, // kg
        force_constant: 6.43, // N/A
        mass_deviation: 0.0, // kg
        force_constant_deviation: 0.0, // N/A
    },
    amplifier: Amplifier { step: 0.001, zero_code: 2048, inverted: false }, // A per code
    disturbance_cutoff: 628.0, // rad/s
    reaction_force_cutoff: 628.0, // rad/s
    observer: Anchored::new(LinearObserver::new(
        [ // transition
            [0.9843311, 0.0009895414, 0.007798419, 5.209004e-6, 2.4011595e-5, 1.3503849e-8, 1.798249e-21, 0.0, 6.0156494e-23],
            [-31.16643, 0.9739423, 15.460057, 0.012951772, 0.08203421, 5.1356332e-5, -2.2277491e-17, 0.0, -2.6689822e-18],
            [0.007798419, 5.209004e-6, 0.9843551, 0.0009895549, 0.007822431, 5.2225078e-6, -8.647713e-19, 0.0, -3.3730156e-19],
            [15.460057, 0.012951772, -31.084396, 0.9739936, 15.542091, 0.013003128, 5.9003174e-18, 0.0, -2.4129615e-18],
            [2.4011595e-5, 1.3503849e-8, 0.007822431, 5.2225078e-6, 0.9921535, 0.0009947639, -5.590879e-21, 0.0, -3.7416227e-21],
            [0.08203421, 5.1356332e-5, 15.542091, 0.013003128, -15.624339, 0.9869454, -6.786527e-18, -0.0, -2.6375584e-18],
            [-138.24734, -0.1228058, -0.8242557, -0.0005249439, -0.0022394755, -1.2316025e-6, 0.533658, -0.0, 0.46634194],
            [-39.0876, -0.02751114, -0.13649353, -7.8343495e-5, -0.0002732726, -1.4105407e-7, 0.33513725, 0.533658, 0.1312047],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ],
        [-0.0009947639, 0.0130546, -0.0009999864, 5.1472656e-5, -0.0009999999, 1.16325545e-7, 0.12333197, 0.027589625, 0.0], // input
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0], // output
        [-0.0020844769, -0.47140098, -0.0029773635, -0.048581157, -0.002555638, -0.11779711, 0.6633836, 0.4508329, 0.22231743], // correction
    )),
    regulator: Regulator { // A/m, A s/m
        actuator: MassGain { position: 59.395927, velocity: 1.1318438 },
        loads: [
            MassGain { position: -26.557281, velocity: 0.056458663 },
            MassGain { position: -6.901524, velocity: 0.15810709 },
            MassGain { position: 2.2091177, velocity: 0.21267912 },
        ],
    },
    limits: Limits { current_limit: 2.0, current_resolution: 0.001 }, // A
    motion: MotionLimits {
        velocity: 0.5, // m/s
        acceleration: 10.0, // m/s^2
        jerk: 200.0, // m/s^3
        total_mass: 0.116, // kg
    },
    holding_force: 0.0, // N
    protection: ProtectionLimits {
        encoder_step: 0.00010862712, // m
        velocity: 2.0, // m/s
        following_error: 0.16755578, // m
        reaction_force: 25.72, // N
        disturbance: 1.929, // N
        innovation: 1.929, // N
        deflection: [0.08573333, 0.08573333, 0.08573333], // m
        stiction: 0.3858, // N
        saturation_time: 0.25, // s
        continuous_current: 1.4, // A
        thermal_time: 10.0, // s
        travel: None, // counts from zero
    },
};
