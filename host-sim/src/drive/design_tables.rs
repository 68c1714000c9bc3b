//! The tables that say what is wanted of a drive: sampling, observer, cost, limits of a move.

use super::document::{Document, LARGEST, SMALLEST};
use super::schema::{Number, RawControl, RawCost, RawGain, RawMotion, RawObserver, RawProtection};
use super::{
    Control, Cost, Observer, ObserverMethod, ObserverSettings, StatedMotion, StatedProtection,
    Weights,
};
use crate::error::Result;
use toml::Spanned;

impl Document<'_> {
    pub(super) fn sample_time(&self, value: &Number) -> Result<f64> {
        let ok = (1e-6..=1.0).contains(value.get_ref());
        self.checked("control.sample_time", value, ok, "from 1e-6 to 1 s")
    }

    pub(super) fn control(&self, raw: &RawControl) -> Result<Control> {
        let sample_time = self.sample_time(&raw.sample_time)?;
        let nyquist = std::f64::consts::PI / sample_time;
        let cutoff = |key: &str, value: &Number| {
            let ok = (SMALLEST..nyquist).contains(value.get_ref());
            let allowed = format!("above 0 and below pi / sample_time = {nyquist:.4} rad/s");
            self.checked(key, value, ok, &allowed)
        };
        let observer = self.one_of(
            "control.observer",
            &raw.observer,
            &Observer::ALL.map(|observer| (observer.name(), observer)),
        )?;
        Ok(Control {
            sample_time,
            disturbance_cutoff: cutoff("control.disturbance_cutoff", &raw.disturbance_cutoff)?,
            reaction_force_cutoff: cutoff(
                "control.reaction_force_cutoff",
                &raw.reaction_force_cutoff,
            )?,
            observer,
        })
    }

    /// How the observer is designed; what the file leaves out is the default.
    pub(super) fn observer(
        &self,
        raw: Option<&RawObserver>,
        control: &Control,
    ) -> Result<ObserverSettings> {
        let mut settings = ObserverSettings::default();
        let Some(raw) = raw else { return Ok(settings) };
        if let Some(design) = &raw.design {
            let words = [
                ("kalman", ObserverMethod::Kalman),
                ("poles", ObserverMethod::Poles),
            ];
            settings.design = self.one_of("observer.design", design, &words)?;
            if settings.design == ObserverMethod::Poles && control.observer == Observer::Reaction {
                let message = "observer.design = \"poles\": must be \"kalman\" for \
                               control.observer = \"reaction\", whose rigid motion cannot be placed";
                return Err(self.error(Some(design.span()), message.into()));
            }
        }
        settings.disturbance = raw.disturbance.unwrap_or(settings.disturbance);
        if let Some(speed) = &raw.speed {
            let ok = (1.0..=100.0).contains(speed.get_ref());
            settings.speed = self.checked("observer.speed", speed, ok, "from 1 to 100")?;
        }
        if let Some(ratio) = &raw.load_force_ratio {
            settings.load_force_ratio = self.positive("observer.load_force_ratio", ratio, "")?;
        }
        if let Some(rate) = &raw.disturbance_rate {
            settings.disturbance_rate = self.positive("observer.disturbance_rate", rate, "1/s")?;
        }
        Ok(settings)
    }

    /// The weights, however they are stated.
    ///
    /// * `loads`: number of load masses
    pub(super) fn cost(&self, raw: &Spanned<RawCost>, loads: usize) -> Result<Cost> {
        let cost = raw.get_ref();
        let units = self.units();
        let (per_position, per_velocity) = (units.position_weight, units.velocity_weight);
        let current = self.positive("cost.current", &cost.current, "1/A^2")?;
        let stated = (
            &cost.position,
            &cost.velocity,
            &cost.energy,
            &cost.settling_time,
        );
        let weights = match stated {
            (Some(position), Some(velocity), None, None) => Weights::Given {
                position: self.weights("cost.position", position, loads, per_position, true)?,
                velocity: self.weights("cost.velocity", velocity, loads, per_velocity, false)?,
            },
            (None, None, Some(energy), None) => {
                Weights::Energy(self.positive("cost.energy", energy, "(1 / J)")?)
            }
            (None, None, None, Some(time)) => Weights::SettlingTime {
                seconds: self.positive("cost.settling_time", time, "s")?,
                place: self.place(Some(time.span())),
            },
            _ => {
                let message = "[cost] must have either both position and velocity, or energy \
                               alone, or settling_time alone";
                return Err(self.error(Some(raw.span()), message.into()));
            }
        };
        let terminal = |key: &str, value: &Option<Spanned<Vec<Number>>>, unit: &str| match value {
            None => Ok(vec![0.0; loads + 1]),
            Some(value) => self.weights(key, value, loads, unit, false),
        };
        let terminal = terminal(
            "cost.terminal_position",
            &cost.terminal_position,
            &format!("s {per_position}"),
        )?
        .into_iter()
        .zip(terminal(
            "cost.terminal_velocity",
            &cost.terminal_velocity,
            &format!("s {per_velocity}"),
        )?);
        Ok(Cost {
            current,
            weights,
            terminal: terminal.flat_map(|(x, v)| [x, v]).collect(),
        })
    }

    /// The gain, where it is stated itself.
    ///
    /// * `loads`: number of load masses
    pub(super) fn gain(&self, raw: &Spanned<RawGain>, loads: usize) -> Result<Weights> {
        let units = self.units();
        let gains = |key: &str, raw: &Spanned<Vec<Number>>, unit: &str| {
            let entries = self.one_per_mass(key, raw, loads)?.iter().enumerate();
            let gains = entries.map(|(i, value)| {
                let ok = value.get_ref().abs() <= LARGEST;
                let allowed = format!("from -{LARGEST:e} to {LARGEST:e} {unit}");
                self.checked(&format!("{key}[{i}]"), value, ok, &allowed)
            });
            gains.collect::<Result<Vec<_>>>()
        };
        let RawGain { position, velocity } = raw.get_ref();
        let stated = gains("gain.position", position, units.position_gain)?;
        let sum: f64 = stated.iter().sum();
        if sum < SMALLEST {
            let message = format!(
                "gain.position: the sum of its entries is {sum}: must be at least {SMALLEST:e} {}, or nothing \
                 holds the machine at its target",
                units.position_gain
            );
            return Err(self.error(Some(position.span()), message));
        }
        Ok(Weights::Gain {
            position: stated,
            velocity: gains("gain.velocity", velocity, units.velocity_gain)?,
        })
    }

    /// The entries of a list with one for each mass.
    fn one_per_mass<'r>(
        &self,
        key: &str,
        raw: &'r Spanned<Vec<Number>>,
        loads: usize,
    ) -> Result<&'r [Number]> {
        let entries = raw.get_ref();
        if entries.len() == loads + 1 {
            return Ok(entries);
        }
        let message = format!(
            "{key} has {} entries: must have {}, one per mass, actuator first",
            entries.len(),
            loads + 1
        );
        Err(self.error(Some(raw.span()), message))
    }

    fn weights(
        &self,
        key: &str,
        raw: &Spanned<Vec<Number>>,
        loads: usize,
        unit: &str,
        needed: bool,
    ) -> Result<Vec<f64>> {
        let weights = self.one_per_mass(key, raw, loads)?.iter().enumerate();
        let weights = weights
            .map(|(i, value)| self.not_negative(&format!("{key}[{i}]"), Some(value), unit))
            .collect::<Result<Vec<_>>>()?;
        if needed && weights.iter().all(|weight| *weight == 0.0) {
            let message = format!("{key}: one entry at least must be greater than zero");
            return Err(self.error(Some(raw.span()), message));
        }
        Ok(weights)
    }

    /// Limits of planned moves, as far as they are stated.
    ///
    /// * `loads`: number of load masses
    pub(super) fn motion(&self, raw: &RawMotion, loads: usize) -> Result<StatedMotion> {
        let units = self.units();
        let stated = |key: &str, value: &Option<Number>, unit: &str| {
            let value = value.as_ref();
            value
                .map(|value| self.positive(&format!("move.{key}"), value, unit))
                .transpose()
        };
        let share = raw.current_share.as_ref().map(|share| {
            let ok = *share.get_ref() > 0.0 && *share.get_ref() <= 1.0;
            self.checked("move.current_share", share, ok, "above 0 and at most 1")
        });
        let table = raw.table.as_ref().map(|table| {
            let bytes = usize::try_from(*table.get_ref()).unwrap_or(0);
            if (1024..=1 << 20).contains(&bytes) {
                Ok(bytes)
            } else {
                let message = format!(
                    "move.table = {}: must be from 1024 to 1048576 bytes",
                    table.get_ref()
                );
                Err(self.error(Some(table.span()), message))
            }
        });
        let deflection = raw.deflection.as_ref().map(|deflection| {
            let entries = deflection.get_ref();
            if entries.len() != loads {
                let message = format!(
                    "move.deflection has {} entries: must have {loads}, one per spring",
                    entries.len()
                );
                return Err(self.error(Some(deflection.span()), message));
            }
            let entries = entries.iter().enumerate();
            entries
                .map(|(i, value)| {
                    self.positive(&format!("move.deflection[{i}]"), value, units.position)
                })
                .collect::<Result<Vec<_>>>()
        });
        Ok(StatedMotion {
            velocity: stated("velocity", &raw.velocity, units.velocity)?,
            acceleration: stated("acceleration", &raw.acceleration, units.acceleration)?,
            jerk: stated("jerk", &raw.jerk, units.jerk)?,
            deflection: deflection.transpose()?,
            current_share: share.transpose()?,
            table: table.transpose()?,
            settling_tolerance: stated(
                "settling_tolerance",
                &raw.settling_tolerance,
                units.position,
            )?,
        })
    }

    /// Limits of a running drive, as far as they are stated.
    ///
    /// * `resolution`: of the encoder, m
    pub(super) fn protection(
        &self,
        raw: Option<&RawProtection>,
        resolution: f64,
    ) -> Result<StatedProtection> {
        let Some(raw) = raw else {
            return Ok(StatedProtection::default());
        };
        let units = self.units();
        let stated = |key: &str, value: &Option<Number>, unit: &str| {
            let value = value.as_ref();
            value
                .map(|value| self.positive(&format!("protection.{key}"), value, unit))
                .transpose()
        };
        Ok(StatedProtection {
            encoder_step: stated("encoder_step", &raw.encoder_step, units.position)?,
            velocity: stated("velocity", &raw.velocity, units.velocity)?,
            following_error: stated("following_error", &raw.following_error, units.position)?,
            reaction_force: stated("reaction_force", &raw.reaction_force, units.force)?,
            disturbance: stated("disturbance", &raw.disturbance, units.force)?,
            innovation: stated("innovation", &raw.innovation, units.force)?,
            tracking_error: stated("tracking_error", &raw.tracking_error, units.position)?,
            deflection: stated("deflection", &raw.deflection, units.position)?,
            stiction: stated("stiction", &raw.stiction, units.force)?,
            saturation_time: stated("saturation_time", &raw.saturation_time, "s")?,
            continuous_current: stated("continuous_current", &raw.continuous_current, "A")?,
            thermal_time: stated("thermal_time", &raw.thermal_time, "s")?,
            travel: raw
                .travel
                .as_ref()
                .map(|travel| self.travel(travel, resolution))
                .transpose()?,
        })
    }

    /// The two ends of the travel, with two whole counts at least between them.
    fn travel(&self, raw: &Spanned<Vec<Number>>, resolution: f64) -> Result<[f64; 2]> {
        let unit = self.units().position;
        let ends: Vec<f64> = raw.get_ref().iter().map(|end| *end.get_ref()).collect();
        match ends[..] {
            [lowest, highest]
                if highest - lowest >= 3.0 * resolution
                    && lowest.abs().max(highest.abs()) <= LARGEST =>
            {
                Ok([lowest, highest])
            }
            _ => {
                let message = format!(
                    "protection.travel = {ends:?}: must be two numbers, the lower end first, three \
                     counts of {resolution:e} {unit} apart at least, within {LARGEST:e} {unit}"
                );
                Err(self.error(Some(raw.span()), message))
            }
        }
    }
}
