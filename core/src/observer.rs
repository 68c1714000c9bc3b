//! Action-reaction state observer, eq. (17): from the reaction force to the motion of every mass.
//!
//! [`StateObserver`] is what the corridor asks of one; [`anchored`] is the default, [`reaction`] the
//! paper's as printed, for comparison. Both are a [`LinearObserver`], which predicts over one period,
//! exactly for a held input, and then corrects with the reaction force:
//!
//! ```text
//! z_k|k−1 = z_k−1 + (F − 1) z_k−1 + g u_k        z_k = z_k|k−1 + L (f_reac_hat − c z_k|k−1)
//! ```
//!
//! Kept is the change over a period, `F − 1`, and not the transition `F`: at 20 kHz a mode of 12 Hz turns by 4 mrad in a
//! period, the cosine of which is 1 − 7·10⁻⁶, and an `f32` near 1 knows the second term to 0.4 % only.
//!
//! Only the states `z`, the input `u` and the coefficients `F, g, c, L` differ. A variant is a file
//! beside these two and a line here. See [`theory`](crate::theory), (17).

pub mod anchored;
pub mod reaction;

pub use anchored::Anchored;
pub use reaction::Reaction;

use crate::check::{SettingsError, finite};
use crate::units::{Current, Force, Position, Velocity};
use nalgebra::{RowSVector, SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// What the corridor asks of a state observer of `N` loads.
pub trait StateObserver<const N: usize> {
    /// Number by which coefficients in serialised form say of which variant they are.
    const FORM: u8;

    /// What it keeps from one period to the next.
    type Memory: Clone + core::fmt::Debug;

    /// Refuses coefficients that cannot be run.
    ///
    /// # Errors
    /// [`SettingsError::NotFinite`] with the name of the coefficient.
    fn check(&self) -> Result<(), SettingsError>;

    /// Whether one part of the coefficients is as in a copy, a different part for each of as many numbers as
    /// there are states.
    fn same(&self, copy: &Self, part: usize) -> bool;

    /// The memory at rest: every mass at the actuator's position, which is zero, and a steady force on the
    /// actuator that the motor holds.
    fn at_rest(&self, disturbance: Force) -> Self::Memory;

    /// Positions are relative to a place that moves by a distance, m.
    fn shift(&self, memory: &mut Self::Memory, distance: Position);

    /// One period.
    fn step(&self, memory: &mut Self::Memory, seen: &Seen) -> Estimate<N>;
}

/// What is seen of the actuator in one period.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Measured position, relative to the target.
    pub position: Position,
    /// Mean velocity over the period.
    pub mean_velocity: Velocity,
    /// Velocity through the disturbance observer's filter.
    pub velocity: Velocity,
    /// Current that was applied over the period.
    pub current: Current,
    /// Force found by (18).
    pub reaction_force: Force,
}

/// Estimate of the whole chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate<const N: usize> {
    /// Position of the actuator, relative to the target.
    pub position: Position,
    /// Velocity of the actuator.
    pub velocity: Velocity,
    /// Position of each load relative to the actuator, `x_i − x_a`, m.
    pub deflection: [f32; N],
    /// Velocity of each load, m/s.
    pub load_velocity: [f32; N],
    /// Disturbance on the actuator; zero where the observer has none.
    pub disturbance: Force,
    /// Reaction force that the model did not expect, before it was corrected by it.
    pub innovation: Force,
}

/// At rest at the target.
impl<const N: usize> Default for Estimate<N> {
    fn default() -> Self {
        Self {
            position: Position(0.0),
            velocity: Velocity(0.0),
            deflection: [0.0; N],
            load_velocity: [0.0; N],
            disturbance: Force(0.0),
            innovation: Force(0.0),
        }
    }
}

/// A linear observer of `S` states: one input, corrected by one output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinearObserver<const S: usize> {
    /// Change over one period, `F − 1` with the transition `F`.
    pub change: SMatrix<f32, S, S>,
    /// Response `g` to the held input.
    pub input: SVector<f32, S>,
    /// Output row `c`, N per unit of state.
    pub output: RowSVector<f32, S>,
    /// Correction `L`, unit of state per N.
    pub correction: SVector<f32, S>,
}

impl<const S: usize> LinearObserver<S> {
    /// From plain arrays, as a generated file has them; the change row by row.
    #[must_use]
    pub const fn new(
        rows: [[f32; S]; S],
        input: [f32; S],
        output: [f32; S],
        correction: [f32; S],
    ) -> Self {
        use nalgebra::ArrayStorage;
        // Stored column by column.
        let mut columns = [[0.0; S]; S];
        let mut output_columns = [[0.0]; S];
        let mut i = 0;
        while i < S {
            let mut j = 0;
            while j < S {
                columns[j][i] = rows[i][j];
                j += 1;
            }
            output_columns[i] = [output[i]];
            i += 1;
        }
        Self {
            change: SMatrix::from_array_storage(ArrayStorage(columns)),
            input: SMatrix::from_array_storage(ArrayStorage([input])),
            output: SMatrix::from_array_storage(ArrayStorage(output_columns)),
            correction: SMatrix::from_array_storage(ArrayStorage([correction])),
        }
    }

    fn check(&self) -> Result<(), SettingsError> {
        finite("observer.change", self.change.iter())?;
        finite("observer.input", self.input.iter())?;
        finite("observer.output", self.output.iter())?;
        finite("observer.correction", self.correction.iter())
    }

    /// See [`StateObserver::same`].
    fn same(&self, copy: &Self, part: usize) -> bool {
        let part = part % S;
        // By their bits and without a branch, which is faster than as numbers.
        let different = |a: &[f32], b: &[f32]| {
            let pairs = a.iter().zip(b);
            pairs.fold(0, |different, (a, b)| {
                different | (a.to_bits() ^ b.to_bits())
            })
        };
        let columns = self.change.as_slice().chunks_exact(S).nth(part);
        let copied = copy.change.as_slice().chunks_exact(S).nth(part);
        let vectors = [
            (self.input.as_slice(), copy.input.as_slice()),
            (self.output.as_slice(), copy.output.as_slice()),
            (self.correction.as_slice(), copy.correction.as_slice()),
        ];
        let column = columns.zip(copied).map_or(1, |(a, b)| different(a, b));
        vectors.iter().fold(column, |found, (a, b)| {
            let pair = a.get(part).zip(b.get(part));
            found | pair.map_or(1, |(a, b)| a.to_bits() ^ b.to_bits())
        }) == 0
    }

    /// Predicts and corrects the state `z`; the innovation.
    fn step(&self, z: &mut SVector<f32, S>, input: f32, reaction_force: Force) -> Force {
        // Summed up before it comes to the state: what is small is not rounded as what is large.
        let mut change = self.input * input;
        for (column, z) in self.change.column_iter().zip(z.iter()) {
            change.axpy(*z, &column, 1.0);
        }
        let predicted = *z + change;
        let innovation = reaction_force.0 - (self.output * predicted).x;
        *z = predicted + self.correction * innovation;
        Force(innovation)
    }
}
