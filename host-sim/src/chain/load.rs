//! The load by itself, eq. (16): `dx_p/dt = A_p x_p + B_p f_reac`, and the same in coordinates relative to
//! the actuator, in which an observer can know it.
//!
//! The force that enters, `f_reac = k_1 (x_a − x_1) + c_1 (v_a − v_1)`, is the spring at the actuator
//! ([`Chain::reaction_force`]). With that spring counted to the load, its input is the actuator's motion.

use super::Chain;
use nalgebra::{DMatrix, DVector};

/// The load of eq. (16) on an actuator whose motion is given: `A`, `b` for the states `r_1 v_1 …
/// r_n v_n`, positions relative to the actuator, and the actuator's velocity as input. `A` is that of the
/// loads on a held actuator.
#[must_use]
pub fn on_moving_actuator(chain: &Chain) -> (DMatrix<f64>, DVector<f64>) {
    let n = 2 * chain.loads();
    // The loads' rows of the free chain: the actuator's position drops out, its velocity becomes the
    // input.
    let whole = chain.a();
    let a = whole.view((2, 2), (n, n)).into_owned();
    let mut b = DVector::zeros(n);
    for load in 0..chain.loads() {
        b[2 * load] = -1.0;
        b[2 * load + 1] = whole[(2 * load + 3, 1)];
    }
    (a, b)
}

/// Relative motion `(x_i − x_a, v_i − v_a)` of a chain: the matrix that forms it from the state, and
/// the one that forms a state from it with the centre of mass held still.
///
/// Spring forces depend on the relative motion alone, so its rows of `A` close on themselves.
#[must_use]
pub fn relative_motion(chain: &Chain) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = 2 * chain.loads();
    let relative = DMatrix::from_fn(n, n + 2, |row, column| {
        if column == row + 2 {
            1.0
        } else if column == row % 2 {
            -1.0
        } else {
            0.0
        }
    });
    let total: f64 = chain.mass.iter().sum();
    let lift = DMatrix::from_fn(n + 2, n, |row, column| {
        let share = if row % 2 == column % 2 {
            -chain.mass[column / 2 + 1] / total
        } else {
            0.0
        };
        share + if row == column + 2 { 1.0 } else { 0.0 }
    });
    (relative, lift)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the actuator pulls along without moving relative to it stands still in both coordinates:
    /// a velocity that all share leaves every spring as it is.
    #[test]
    fn a_rigid_motion_is_none_of_the_loads() {
        let chain = Chain::of_table_1(300.0, 0.1);
        let (a, b) = on_moving_actuator(&chain);
        let moving = DVector::from_fn(6, |i, _| f64::from(u8::from(i % 2 == 1)));
        assert!((a * &moving + b).amax() < 1e-12);
        let (relative, lift) = relative_motion(&chain);
        let rigid = DVector::from_fn(8, |i, _| f64::from(u8::from(i % 2 == 1)));
        assert!((&relative * rigid).amax() < 1e-15);
        assert!((relative * lift - DMatrix::identity(6, 6)).amax() < 1e-12);
    }
}
