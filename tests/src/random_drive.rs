//! Drives drawn at random, for campaigns.

use host_sim::drive::{Drive, StatedMotion, Weights};
use host_sim::machine::Load;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Drawn evenly over the logarithm.
pub(crate) fn log_uniform(random: &mut ChaCha8Rng, from: f64, to: f64) -> f64 {
    random.random_range(from.ln()..to.ln()).exp()
}

/// The default drive with another machine: loads that weigh from a fifth to `heaviest` times the actuator, modes
/// from 4 Hz on, acceleration of the whole from 20 to 200 m/s². And the modes' frequency, rad/s.
///
/// * `most`: number of loads
pub(crate) fn machine(random: &mut ChaCha8Rng, most: i32, heaviest: f64) -> (Drive, f64) {
    let mut drive = Drive::default_drive();
    let loads = random.random_range(1..=most);
    let actuator = log_uniform(random, 0.03, 3.0);
    let load = actuator * log_uniform(random, 0.2, heaviest) / f64::from(loads);
    let omega = std::f64::consts::TAU * log_uniform(random, 4.0, 25.0);
    drive.actuator.mass = actuator;
    // Of the whole, m/s².
    let acceleration = log_uniform(random, 20.0, 200.0);
    let total = actuator + load * f64::from(loads);
    drive.actuator.force_constant = acceleration * total / drive.actuator.current_limit;
    drive.loads = (0..loads)
        .map(|_| {
            let mass = load * random.random_range(0.7..1.4);
            let stiffness = mass * (omega * random.random_range(0.8..1.3)).powi(2);
            let damping = 2.0 * random.random_range(0.004..0.05) * (stiffness * mass).sqrt();
            Load {
                mass,
                stiffness,
                damping,
                ..Load::default()
            }
        })
        .collect();
    drive.cost.terminal = vec![0.0; 2 * drive.loads.len() + 2];
    drive.motion = StatedMotion::default();
    (drive, omega)
}

/// Weights by which a machine of such modes settles, within what they allow.
pub(crate) fn weights(random: &mut ChaCha8Rng, omega: f64) -> Weights {
    Weights::SettlingTime {
        seconds: log_uniform(random, 12.0, 25.0) / omega,
        place: String::new(),
    }
}
