//! Friction on the actuator, as numbers; [`motion`](super::motion) is what it does.

/// Friction on the actuator.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Friction {
    /// N.
    pub coulomb: f64,
    /// Of motion backwards, N, where it is another.
    pub coulomb_backward: Option<f64>,
    /// By how much more it holds at rest, either way, N.
    pub breakaway: f64,
    /// At which most of that is gone, m/s.
    pub stribeck_velocity: f64,
    /// N s/m.
    pub viscous: f64,
}

impl Friction {
    /// The same with so many times the dry friction.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            coulomb: self.coulomb * factor,
            coulomb_backward: self.coulomb_backward.map(|backward| backward * factor),
            breakaway: self.breakaway * factor,
            ..self.clone()
        }
    }

    /// The dry part of it.
    #[must_use]
    pub fn dry(&self) -> DryFriction {
        DryFriction {
            forward: self.coulomb,
            backward: self.coulomb_backward.unwrap_or(self.coulomb),
            breakaway: self.breakaway,
            stribeck_velocity: self.stribeck_velocity,
        }
    }
}

/// Dry friction on a mass: at velocity `v` against the motion `c + breakaway e^{-(v / v_s)^2}`, at rest up to
/// that of `v = 0` against what pushes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DryFriction {
    /// `c` of motion forwards, N; negative, as a fit may try it, it pushes.
    pub forward: f64,
    /// `c` of motion backwards, N.
    pub backward: f64,
    /// By how much more it holds at rest, N.
    pub breakaway: f64,
    /// `v_s`, m/s; above 0 where there is more at rest.
    pub stribeck_velocity: f64,
}

impl DryFriction {
    /// The same either way, at rest and in motion.
    #[must_use]
    pub fn coulomb(newton: f64) -> Self {
        Self {
            forward: newton,
            backward: newton,
            ..Self::default()
        }
    }

    /// Whether there is any.
    #[must_use]
    pub fn any(&self) -> bool {
        self.forward != 0.0 || self.backward != 0.0 || self.breakaway != 0.0
    }

    /// Against motion in the direction of a velocity that is not zero, N.
    #[must_use]
    pub fn sliding(&self, velocity: f64) -> f64 {
        let coulomb = self.in_direction(velocity);
        if self.breakaway == 0.0 {
            return coulomb;
        }
        coulomb + self.breakaway * (-(velocity / self.stribeck_velocity).powi(2)).exp()
    }

    /// Most that holds against what pushes in a direction, N.
    #[must_use]
    pub fn holding(&self, direction: f64) -> f64 {
        self.in_direction(direction) + self.breakaway
    }

    fn in_direction(&self, direction: f64) -> f64 {
        if direction > 0.0 {
            self.forward
        } else {
            self.backward
        }
    }
}
