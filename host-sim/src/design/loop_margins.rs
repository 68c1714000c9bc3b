//! Margins of the loop, broken at the current command.
//!
//! The sampled loop from the command through plant, encoder, force observers, state observer and
//! regulator back to the command, evaluated at `z = e^{jωT}`. The observers are fed with the
//! command that the drive gives, as in the drive; what is varied is the current that flows in
//! answer to it. The delay and the lag that the drive file states are in the loop.

use super::Design;
use super::drive_loop::{Compensation, DriveLoop};
use crate::error::Result;
use crate::linear::margins::Margins;
use crate::linear::response::Response;
use nalgebra::{Complex, DMatrix, DVector};

type C = Complex<f64>;

/// Of the drive's own loop in both states that the rule for rest knows.
#[derive(Clone, Debug)]
pub struct LoopMargins {
    /// While the compensation follows.
    pub following: Margins,
    /// While it is held.
    pub held: Margins,
}

impl LoopMargins {
    /// * `of`: [`of_drive`] or [`of_drive_at_first_look`]
    ///
    /// # Errors
    /// As these.
    pub(in crate::design) fn new(
        design: &Design,
        of: impl Fn(&Design, Compensation) -> Result<Margins>,
    ) -> Result<Self> {
        Ok(Self {
            following: of(design, Compensation::Follows)?,
            held: of(design, Compensation::Held)?,
        })
    }

    /// Additional delay that destabilises, s; the less of both.
    pub(in crate::design) fn delay(&self) -> Option<f64> {
        let delays = [&self.following, &self.held].map(|margins| margins.delay_margin);
        delays.into_iter().flatten().reduce(f64::min)
    }
}

/// Of the drive's own loop, observers included.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when the response cannot be computed.
pub fn of_drive(design: &Design, compensation: Compensation) -> Result<Margins> {
    of_drive_looked_at(design, compensation, Look::Close)
}

/// A first look at the same, see [`Margins::coarse`].
///
/// # Errors
/// As [`of_drive`].
pub fn of_drive_at_first_look(design: &Design, compensation: Compensation) -> Result<Margins> {
    of_drive_looked_at(design, compensation, Look::First)
}

fn of_drive_looked_at(design: &Design, compensation: Compensation, look: Look) -> Result<Margins> {
    let drive = DriveLoop::new(design, compensation).response();
    of(design, look, |z, plant| {
        drive.at(z).map(|response| response * plant[0])
    })
}

/// How closely a loop is looked at.
#[derive(Clone, Copy)]
enum Look {
    First,
    Close,
}

/// Of the same gain on the true state.
///
/// # Errors
/// As [`of_drive`].
pub fn of_full_state(design: &Design) -> Result<Margins> {
    let gain = design.regulator.map(C::from);
    of(design, Look::Close, |_, plant| {
        Some(-(&gain * plant.rows(0, gain.len())).x)
    })
}

/// `command`: command in answer to the plant's state, so that `L = −command`.
fn of(
    design: &Design,
    look: Look,
    command: impl Fn(C, &DVector<C>) -> Option<C>,
) -> Result<Margins> {
    let period = design.drive.control.sample_time;
    let (ad, bd) = design.sampled(&design.chain);
    let plant = Response::new(&ad, &bd, &DMatrix::identity(bd.len(), bd.len()));
    let response = |omega: f64| -> Option<C> {
        let z = C::from_polar(1.0, omega * period);
        command(z, &plant.at(z)?).map(|command| -command)
    };
    let nyquist = std::f64::consts::PI / period;
    let slowest = design.regulator_decay()?;
    Ok(match look {
        Look::First => Margins::coarse(response, nyquist, slowest)?,
        Look::Close => Margins::new(response, nyquist, slowest)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, PlantFile};
    use crate::linear::eigen::spectral_radius;
    use crate::machine::ExternalForce;
    use crate::simulate::ending::peak_to_peak;
    use crate::simulate::scenario::Scenario;
    use crate::simulate::{Law, simulate};

    fn design() -> Design {
        Design::new(&Drive::default_drive()).unwrap()
    }

    /// Feedback of the full state has 24 dB and 6.4 ms (`arso_core::theory`, Margins). Independent of the
    /// frequency response: with six samples of delay in the loop its poles are inside the unit circle, with
    /// seven they are not, and the margin of 6.4 ms is between.
    #[test]
    fn full_state_margins_are_as_computed_elsewhere() {
        let margins = of_full_state(&design()).unwrap();
        println!("{margins:?}");
        assert!((margins.gain_margin_db.unwrap() - 24.0).abs() < 0.5);
        assert!((margins.delay_margin.unwrap() - 6.3e-3).abs() < 0.2e-3);
        let design = design();
        for (delay, stable) in [(6, true), (7, false)] {
            let n = design.ad.nrows();
            let mut closed = DMatrix::zeros(n + delay, n + delay);
            closed.view_mut((0, 0), (n, n)).copy_from(&design.ad);
            closed.view_mut((0, n), (n, 1)).copy_from(&design.bd);
            for i in 1..delay {
                closed[(n + i - 1, n + i)] = 1.0;
            }
            closed
                .view_mut((n + delay - 1, 0), (1, n))
                .copy_from(&-&design.regulator);
            assert_eq!(spectral_radius(&closed).unwrap() < 1.0, stable, "{delay}");
        }
    }

    /// Independent of the frequency response: at the gain margin the closed loop's largest pole is
    /// on the unit circle.
    #[test]
    fn the_loop_is_on_the_brink_at_its_gain_margin() {
        let design = design();
        let margin = of_full_state(&design).unwrap().gain_margin_db.unwrap();
        for (factor, stable) in [(0.99, true), (1.01, false)] {
            let gain = factor * 10_f64.powf(margin / 20.0);
            let closed = &design.ad - &design.bd * &design.regulator * gain;
            assert_eq!(spectral_radius(&closed).unwrap() < 1.0, stable);
        }
    }

    /// The drive itself in simulation, before the rule for rest holds the compensation: its motor's force
    /// scaled to just below the gain margin the loop's motion decays, just above it grows.
    #[test]
    fn the_simulated_drive_agrees_with_its_gain_margin() {
        let design = design();
        let margins = of_drive(&design, Compensation::Follows).unwrap();
        println!("{margins:?}");
        let margin = margins.gain_margin_db.unwrap();
        let swing = |factor: f64| {
            let mut plant = PlantFile::from(&design.drive);
            plant.actuator.force_constant *= factor * 10_f64.powf(margin / 20.0);
            let scenario = Scenario::named("fig4").unwrap();
            let run = simulate(&design, &plant, scenario, Law::Core, 0.6).unwrap();
            [200..400, 400..600].map(|part| peak_to_peak(&run.samples[part], 0))
        };
        let (below, above) = (swing(0.93), swing(1.07));
        println!("{below:?} {above:?}");
        assert!(below[1] < 0.7 * below[0], "{below:?}");
        assert!(above[1] > 0.95 * above[0] && above[1] > 1e-3, "{above:?}");
    }

    /// A drive that nothing but a push moves, with a delay and a lag that it knows.
    fn finely_sampled((delay, lag): (f64, f64)) -> Design {
        let mut drive = Drive::default_drive();
        drive.encoder.resolution = 1e-8;
        drive.encoder.counter_bits = 32;
        drive.actuator.current_resolution = 0.0;
        (drive.actuator.delay, drive.actuator.lag) = (delay, lag);
        Design::new(&drive).unwrap()
    }

    /// Motion of a drive at rest that was pushed, soon after and later.
    fn swing(design: &Design, change: impl FnOnce(&mut PlantFile)) -> [f64; 2] {
        let mut plant = PlantFile::from(&design.drive);
        change(&mut plant);
        plant.forces.push(ExternalForce {
            mass: 0,
            start: 1.6,
            duration: 2e-3,
            newton: 0.05,
        });
        let scenario = Scenario::named("fig4").unwrap();
        let run = simulate(design, &plant, scenario, Law::Core, 2.2).unwrap();
        [1610..1800, 1800..2200].map(|part| peak_to_peak(&run.samples[part], 0))
    }

    /// The same of a drive at rest, whose compensation is held: a push on it decays or grows. With delay and lag
    /// as well.
    #[test]
    fn the_simulated_drive_at_rest_agrees_with_its_gain_margin() {
        for late in [(0.0, 0.0), (0.6e-3, 0.4e-3)] {
            let design = finely_sampled(late);
            let [follows, held] = [Compensation::Follows, Compensation::Held].map(|compensation| {
                let margins = of_drive(&design, compensation).unwrap();
                margins.gain_margin_db.unwrap()
            });
            assert!(held < follows, "{held} {follows}");
            let [below, above] = [0.95, 1.05].map(|factor| {
                let factor = factor * 10_f64.powf(held / 20.0);
                swing(&design, |plant| plant.actuator.force_constant *= factor)
            });
            println!("{late:?} {held} {below:?} {above:?}");
            assert!(below[1] < 0.7 * below[0], "{below:?}");
            assert!(above[1] > 1.3 * above[0], "{above:?}");
        }
    }

    /// Delay and lag that the drive file states are in the loop: of whole periods of delay the margin has that much
    /// less, of a part of one nearly so, and the loop's poles leave the circle where no margin is left.
    #[test]
    fn a_stated_delay_is_taken_from_the_margin() {
        for lag in [0.0, 0.3e-3] {
            let late = |delay: f64| {
                let mut design = design();
                (design.drive.actuator.delay, design.drive.actuator.lag) = (delay, lag);
                design
            };
            for compensation in [Compensation::Follows, Compensation::Held] {
                let margin = |delay| of_drive(&late(delay), compensation).unwrap();
                let delays = [0.0, 1e-3, 0.4e-3].map(|delay| margin(delay).delay_margin.unwrap());
                println!("{lag} {compensation:?} {delays:?}");
                assert!((delays[0] - delays[1] - 1e-3).abs() < 1e-5, "{delays:?}");
                assert!((delays[0] - delays[2] - 0.4e-3).abs() < 3e-5, "{delays:?}");
                for (share, stable) in [(0.97, true), (1.03, false)] {
                    let design = late(share * delays[0]);
                    let (ad, bd) = design.sampled(&design.chain);
                    let closed = DriveLoop::new(&design, compensation).closed(&ad, &bd);
                    let radius = spectral_radius(&closed).unwrap();
                    assert_eq!(radius < 1.0, stable, "{lag} {share}: {radius}");
                }
            }
        }
    }

    /// The simulated drive at rest with more force, which leaves it no more delay than commissioning bears with so fine
    /// an encoder, and with a delay: below the margin a push on it decays, above it grows.
    #[test]
    fn the_simulated_drive_at_rest_agrees_with_its_delay_margin() {
        const STRONGER: f64 = 1.7;
        let (design, mut stronger) = (finely_sampled((0.0, 0.0)), finely_sampled((0.0, 0.0)));
        stronger.chain.force_constant *= STRONGER;
        let margin = of_drive(&stronger, Compensation::Held).unwrap();
        let margin = margin.delay_margin.unwrap();
        println!("{margin}");
        let [below, above] = [0.8, 1.2].map(|share| {
            swing(&design, |plant| {
                plant.actuator.force_constant *= STRONGER;
                plant.actuator.delay = share * margin;
            })
        });
        println!("{below:?} {above:?}");
        assert!(below[1] < 0.7 * below[0], "{below:?}");
        assert!(above[1] > 1.3 * above[0], "{above:?}");
    }
}
