//! Start-up as real machines make it difficult: encoder noise, an offset of the amplifier, cogging, gravity, an
//! encoder finer than anything that matters. Core and plant as `simulate` has them, from commissioning until the drive
//! has held for a while.

use arso_core::{Counts, Current, Fault, Measurement, Mode, Request};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::machine::ExternalForce;
use host_sim::simulate::corridor::corridor;
use host_sim::simulate::plant::Plant;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// What the machine has that the drive file does not say.
#[derive(Clone, Copy, Default)]
struct Hidden {
    /// Of the encoder, counts rms.
    noise: f64,
    /// Of the amplifier while it is on, A.
    offset: f64,
    /// Amplitude of the cogging, N, and the angle at which the machine stands in it.
    cogging: (f64, f64),
    seed: u64,
}

/// Distance from one detent of the cogging to the next, m.
const PITCH: f64 = 0.01;

/// The mode in which start-up and half a second of holding leave the drive, and how far it then stands from where
/// it closed the loop, m.
fn started(design: &Design, plant: &PlantFile, hidden: Hidden) -> (Mode, f64) {
    let drive = &design.drive;
    let period = drive.control.sample_time;
    let mut core = corridor(design, None).unwrap();
    let mut plant = Plant::new(plant, period);
    let mut random = ChaCha8Rng::seed_from_u64(hidden.seed);
    let noise = Normal::new(0.0, hidden.noise).unwrap();
    core.request(Request::Commission).unwrap();
    let mut current = Current(0.0);
    let mut began = None;
    for _ in 0..10_000 {
        let counts = noise.sample(&mut random).round() as i32;
        let count = Counts(plant.count().wrapping_add_signed(counts));
        let command = core.step(Measurement {
            count,
            current,
            home: false,
        });
        current = command.current;
        plant.enable(command.enable);
        let flowing = f64::from(current.0) + if command.enable { hidden.offset } else { 0.0 };
        let (amplitude, angle) = hidden.cogging;
        let turned = std::f64::consts::TAU * plant.state()[0] / PITCH + angle;
        let cogging = -amplitude * turned.sin() / drive.actuator.force_constant;
        plant.advance(flowing + cogging).unwrap();
        match (core.record().mode, began) {
            (Mode::Ready, _) => {
                core.request(Request::Start).unwrap();
                began = Some((0, plant.state()[0]));
            }
            (Mode::Running, Some((500, position))) => {
                return (Mode::Running, (plant.state()[0] - position).abs());
            }
            (Mode::Running, Some((periods, position))) => began = Some((periods + 1, position)),
            (mode @ Mode::Fault(_), _) => return (mode, 0.0),
            _ => {}
        }
    }
    (core.record().mode, 0.0)
}

fn default_design() -> Design {
    Design::new(&Drive::default_drive()).unwrap()
}

fn default_plant(change: impl FnOnce(&mut PlantFile)) -> PlantFile {
    let mut plant = PlantFile::from(&Drive::default_drive());
    change(&mut plant);
    plant
}

fn default_with_friction(coulomb: f64) -> PlantFile {
    default_plant(|plant| plant.friction.coulomb = coulomb)
}

/// 1.5 counts rms, without friction, with a little and with some.
#[test]
fn encoder_noise_is_no_motion() {
    let design = default_design();
    for coulomb in [0.0, 0.02, 0.2] {
        for seed in 0..20 {
            let plant = default_with_friction(coulomb);
            let hidden = Hidden {
                noise: 1.5,
                seed,
                ..Hidden::default()
            };
            let (mode, off) = started(&design, &plant, hidden);
            assert_eq!(mode, Mode::Running, "friction {coulomb} N, seed {seed}");
            assert!(off < 200e-6, "friction {coulomb} N, seed {seed}: {off}");
        }
    }
}

/// 0.05 A is a force of 0.32 N that is there as soon as the amplifier is on.
#[test]
fn an_offset_of_the_amplifier_is_carried() {
    let design = default_design();
    for offset in [0.05, -0.05] {
        let hidden = Hidden {
            noise: 0.5,
            offset,
            seed: 1,
            ..Hidden::default()
        };
        let (mode, off) = started(&design, &default_plant(|_| {}), hidden);
        assert_eq!(mode, Mode::Running, "{offset} A");
        assert!(off < 1e-3, "{offset} A: {off}");
    }
}

/// 0.1 N of cogging: in a detent without friction, anywhere with some, two counts of noise besides.
#[test]
fn cogging_is_carried() {
    let design = default_design();
    for eighth in 0..8 {
        let angle = std::f64::consts::TAU * f64::from(eighth) / 8.0;
        for coulomb in [0.0, 0.12, 0.3] {
            if coulomb == 0.0 && eighth != 0 {
                continue;
            }
            let plant = default_with_friction(coulomb);
            let hidden = Hidden {
                noise: 0.5,
                cogging: (0.1, angle),
                seed: 7,
                ..Hidden::default()
            };
            let (mode, off) = started(&design, &plant, hidden);
            assert_eq!(mode, Mode::Running, "{eighth}/8, friction {coulomb} N");
            assert!(off < 1e-3, "{eighth}/8, friction {coulomb} N: {off}");
        }
    }
}

/// An encoder of 1 nm sees every swing of the loads; it is at rest when nothing moves that matters.
#[test]
fn an_encoder_can_be_fine() {
    for resolution in [1e-9, 1e-8, 1e-7] {
        let mut drive = Drive::default_drive();
        drive.encoder.resolution = resolution;
        drive.encoder.counter_bits = 32;
        let design = Design::new(&drive).unwrap();
        let (mode, off) = started(&design, &PlantFile::from(&drive), Hidden::default());
        assert_eq!(mode, Mode::Running, "{resolution} m");
        assert!(off < 20e-6, "{resolution} m: {off}");
    }
}

fn gravity(plant: &mut PlantFile) -> f64 {
    let masses = [plant.actuator.mass, 0.019, 0.019, 0.019];
    plant.forces = (0..)
        .zip(masses)
        .map(|(mass, weight)| ExternalForce {
            mass,
            start: 0.0,
            duration: 1e6,
            newton: 9.81 * weight,
        })
        .collect();
    -9.81 * masses.iter().sum::<f64>()
}

/// A vertical axis: it falls with a drive that knows nothing of it, on the simulated machine as on the board, and
/// does not move by more than some counts with its holding force stated. The estimate of its weight may be 20 % off.
#[test]
fn gravity_is_carried_or_found() {
    for share in [1.0, 0.8, 1.2] {
        let mut weight = 0.0;
        let plant = default_plant(|plant| {
            plant.actuator.brake = true;
            weight = gravity(plant);
        });
        let mut drive = Drive::default_drive();
        drive.actuator.holding_force = share * weight;
        let design = Design::new(&drive).unwrap();
        let (mode, off) = started(&design, &plant, Hidden::default());
        assert_eq!(mode, Mode::Running, "{share}");
        let allowed = if share == 1.0 { 20e-6 } else { 3e-3 };
        assert!(off < allowed, "{share}: {off}");
    }
    let plant = default_plant(|plant| {
        gravity(plant);
    });
    let (mode, _) = started(&default_design(), &plant, Hidden::default());
    // Its counter has 16 bits: falling for two seconds outruns it.
    let found = [Fault::NotAtRest, Fault::EncoderJump];
    assert!(found.map(Mode::Fault).contains(&mode), "{mode:?}");
}
