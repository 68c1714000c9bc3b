//! Kalman filter on the encoder alone, with a disturbance on the actuator: the yardstick for the
//! observer that is driven by the reaction force.
//!
//! States `x_a v_a x_1 v_1 … d` of the free chain, input the applied current, output `x_a`; the same
//! gain `K`, the same compensation of `d` and the same reference as in the drive. In `f64`, on the PC alone.

use super::guide::Guide;
use crate::design::Design;
use crate::design::observer::kalman;
use crate::error::{Error, Result};
use crate::linear::product::{add, dot, product_and};
use crate::linear::zoh::zero_order_hold;
use crate::simulate::{Control, ControlOutput};
use arso_core::encoder::{self, Encoder};
use arso_core::limits::Limiter;
use arso_core::{Counts, Current};
use nalgebra::{DMatrix, DVector, RowDVector};

/// Densities of the noise the filter is made for.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Random force on each load, N/√Hz.
    pub load_force: f64,
    /// Random walk of the disturbance, N/√s.
    pub disturbance: f64,
}

/// The law.
pub(crate) struct EncoderObserver<'d> {
    transition: DMatrix<f64>,
    input: DVector<f64>,
    correction: DVector<f64>,
    state: DVector<f64>,
    /// Where the next one is formed.
    next: DVector<f64>,
    feedback: RowDVector<f64>,
    guide: Guide<'d>,
    /// Of the current that is applied now, what friction was given, A.
    friction: f64,
    limiter: Limiter,
    encoder: (Encoder, encoder::Memory),
}

impl<'d> EncoderObserver<'d> {
    /// # Errors
    /// [`Error::Design`] when the filter's Riccati equation has no solution.
    pub(super) fn new(design: &Design, settings: Settings, guide: Guide<'d>) -> Result<Self> {
        let (chain, drive) = (&design.chain, &design.drive);
        let n = chain.states();
        let period = drive.control.sample_time;
        let mut a = DMatrix::zeros(n + 1, n + 1);
        a.view_mut((0, 0), (n, n)).copy_from(&chain.a());
        a.view_mut((0, n), (n, 1)).copy_from(&-chain.force_input(0));
        let mut b = DVector::zeros(n + 1);
        b.rows_mut(0, n).copy_from(&chain.b());
        let (transition, input) = zero_order_hold(&a, &b, period);
        let mut output = RowDVector::zeros(n + 1);
        output[0] = 1.0;
        // Rounding to counts as a density.
        let measured = drive.encoder.resolution * (period / 12.0).sqrt();
        let mut noise = DMatrix::zeros(n + 1, n + 1);
        for load in 1..=chain.loads() {
            let density = settings.load_force / chain.mass[load] / measured;
            noise[(2 * load + 1, 2 * load + 1)] = density.powi(2);
        }
        noise[(n, n)] = (settings.disturbance / measured).powi(2);
        let correction = kalman(&a, &transition, &output, &noise, period)?;
        let mut feedback = RowDVector::zeros(n + 1);
        feedback.columns_mut(0, n).copy_from(&-&design.regulator);
        feedback[n] = 1.0 / chain.force_constant;
        Ok(Self {
            transition,
            input,
            correction,
            state: DVector::zeros(n + 1),
            next: DVector::zeros(n + 1),
            feedback,
            guide,
            friction: 0.0,
            limiter: design.limits().limiter(),
            encoder: (design.encoder(), encoder::Memory::default()),
        })
    }
}

impl Control for EncoderObserver<'_> {
    fn step(&mut self, count: u32, _: &DVector<f64>, applied: f64) -> Result<ControlOutput> {
        let reading = self.encoder.0.step(&mut self.encoder.1, Counts(count));
        let position = self.encoder.0.position(reading.place);
        let input = (applied - self.friction, &self.input);
        product_and(&self.transition, &self.state, input, &mut self.next);
        let innovation = f64::from(position.0) - self.next[0];
        add(innovation, &self.correction, &mut self.next);
        std::mem::swap(&mut self.state, &mut self.next);
        let led = self.guide.step()?;
        // The disturbance has no reference.
        let references = led.state.iter().copied().chain([0.0]);
        let errors = self.state.iter().zip(references);
        let feedback = dot(
            &self.feedback,
            errors.map(|(state, reference)| state - reference),
        );
        self.friction = led.friction;
        let command = feedback + led.feed_forward + led.friction;
        let limited = self
            .limiter
            .step(Current(command as f32))
            .ok_or_else(|| Error::Simulation("the encoder's filter is no longer finite".into()))?;
        Ok(ControlOutput {
            current: limited.current.0.into(),
            enable: true,
            limited: limited.limited,
            reference: Some(led.state[0]),
        })
    }
}
