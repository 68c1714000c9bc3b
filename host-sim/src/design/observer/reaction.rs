//! Eq. (17) as printed, on the free chain `x_a v_a x_1 v_1 …`; for comparison.
//!
//! Its centre of mass is unobservable, so the gain is designed for the motion relative to it and leaves
//! the centre of mass alone.

use super::{Model, ObserverDesign, Variant, kalman};
use crate::chain::Chain;
use crate::chain::load::relative_motion;
use crate::design::require_stable;
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::linear::eigen::spectral_radius;
use crate::linear::zoh::zero_order_hold;
use nalgebra::{DMatrix, DVector, RowDVector};

pub(super) struct Reaction;

impl Variant for Reaction {
    fn design(&self, drive: &Drive, chain: &Chain, _: f64) -> Result<ObserverDesign> {
        let sample_time = drive.control.sample_time;
        let loads = chain.loads();
        let a = chain.a();
        let (transition, input) = zero_order_hold(&a, &chain.b(), sample_time);

        let (relative, lift) = relative_motion(chain);
        let a_relative = &relative * &a * &lift;
        let output = seen(chain);
        let output_relative = &output * &lift;
        let transition_relative = &relative * &transition * &lift;

        let n = 2 * loads;
        // Random forces on every mass, seen in the relative velocities.
        let mut noise = DMatrix::zeros(n, n);
        for mass in 0..=loads {
            let force = &relative * chain.force_input(mass) * drive.observer.load_force_ratio;
            noise += &force * force.transpose();
        }
        let gain = kalman(
            &a_relative,
            &transition_relative,
            &output_relative,
            &noise,
            sample_time,
        )?;
        let error = (DMatrix::identity(n, n) - &gain * &output_relative) * &transition_relative;
        require_stable("the observer", &error)?;
        let observer = ObserverDesign {
            transition,
            input,
            output,
            correction: lift * gain,
        };
        // With friction in the model the relative motion is not all; nothing may grow but what rounding
        // makes of the rigid motion's double one.
        let radius = spectral_radius(&observer.error_transition())?;
        if radius > 1.0 + 1e-5 {
            return Err(Error::Design(format!(
                "the observer is not stable (largest pole {radius:.6})"
            )));
        }
        Ok(observer)
    }

    fn model(&self, _: &Drive, chain: &Chain) -> Model {
        let (relative, lift) = relative_motion(chain);
        Model {
            a: &relative * chain.a() * &lift,
            c: seen(chain) * &lift,
            forces: 0,
        }
    }

    fn rigid_motion(&self) -> bool {
        true
    }

    fn distinct_eigenvalues(&self, _: &Chain) -> Result<(f64, &'static str)> {
        let advice = "eq. (17) observes the free chain, whose position as a whole makes no reaction \
                      force (a double zero of A without viscous friction): its error is never \
                      corrected and grows under any unmodelled force; use observer = \"anchored\"";
        Ok((0.0, advice))
    }

    fn input(&self, _: f64, current: f64) -> f64 {
        current
    }

    fn estimate(&self, z: &DVector<f64>, _: [f64; 2]) -> (DVector<f64>, f64) {
        (z.clone(), 0.0)
    }
}

/// Output row of the force that (18) finds: the reaction force, and the viscous friction of the actuator,
/// which cannot be told from it.
fn seen(chain: &Chain) -> RowDVector<f64> {
    let mut output = chain.reaction_force();
    output[1] += chain.viscous;
    output
}
