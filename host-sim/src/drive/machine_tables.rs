//! The tables that say what a machine is made of: actuator, encoder, loads, friction, forces.

use super::MAX_LOADS;
use super::document::{Document, LARGEST, SMALLEST};
use super::schema::{
    Number, RawActuator, RawAmplifier, RawEncoder, RawFile, RawForce, RawFriction,
};
use crate::error::Result;
use crate::machine::{Actuator, Encoder, ExternalForce, Friction, Imperfections, Load, Wave};
use toml::Spanned;

/// The middle of twelve bits.
const MIDDLE: u16 = 2048;
/// Velocity in which what holds at rest fades where the file does not say, m/s or rad/s: that of greased guides.
const STRIBECK_VELOCITY: f64 = 5e-3;
/// Longest delay and lag of a force, s, and most control periods of delay that a drive reckons with.
const LONGEST_DELAY: f64 = 0.1;
const LONGEST_LAG: f64 = 1.0;
const MOST_PERIODS: f64 = 4.0;

impl Document<'_> {
    pub(super) fn actuator(
        &self,
        raw: &RawActuator,
        amplifier: Option<&RawAmplifier>,
    ) -> Result<Actuator> {
        let units = self.units();
        let mass = self.positive("actuator.mass", &raw.mass, units.mass)?;
        let force_constant = self.positive(
            "actuator.force_constant",
            &raw.force_constant,
            units.force_constant,
        )?;
        let current_limit = self.positive("actuator.current_limit", &raw.current_limit, "A")?;
        let current_resolution = match &raw.current_resolution {
            None => 0.0,
            Some(value) => {
                let number = *value.get_ref();
                let ok = number == 0.0 || (SMALLEST..=current_limit).contains(&number);
                let allowed = format!(
                    "0 (continuous) or from {SMALLEST:e} A to the current limit of {current_limit} A"
                );
                self.checked("actuator.current_resolution", value, ok, &allowed)?
            }
        };
        let holding_force = match &raw.holding_force {
            None => 0.0,
            Some(value) => {
                let ok = value.get_ref().abs() <= LARGEST;
                let allowed = format!("within {LARGEST:e} {}", units.force);
                self.checked("actuator.holding_force", value, ok, &allowed)?
            }
        };
        let zero_code = match amplifier.and_then(|amplifier| amplifier.zero_code.as_ref()) {
            None => MIDDLE,
            Some(code) => u16::try_from(*code.get_ref()).map_err(|_| {
                let message = format!(
                    "amplifier.zero_code = {}: must be a code of the converter, 0 to {}",
                    code.get_ref(),
                    u16::MAX
                );
                self.error(Some(code.span()), message)
            })?,
        };
        Ok(Actuator {
            zero_code,
            inverted: amplifier
                .and_then(|amplifier| amplifier.inverted)
                .unwrap_or(false),
            holding_force,
            brake: raw.brake.unwrap_or(false),
            mass_deviation: self.deviation(
                "actuator.mass_deviation",
                raw.mass_deviation.as_ref(),
                mass,
                units.mass,
            )?,
            force_constant_deviation: self.deviation(
                "actuator.force_constant_deviation",
                raw.force_constant_deviation.as_ref(),
                force_constant,
                units.force_constant,
            )?,
            mass,
            force_constant,
            current_limit,
            current_resolution,
            delay: match &raw.delay {
                None => 0.0,
                Some(delay) => {
                    let ok = (0.0..=LONGEST_DELAY).contains(delay.get_ref());
                    let allowed = format!("from 0 to {LONGEST_DELAY} s");
                    self.checked("actuator.delay", delay, ok, &allowed)?
                }
            },
            lag: match &raw.lag {
                None => 0.0,
                Some(lag) => {
                    let number = *lag.get_ref();
                    let ok = number == 0.0 || (SMALLEST..=LONGEST_LAG).contains(&number);
                    let allowed = format!("0 (none) or from {SMALLEST:e} to {LONGEST_LAG} s");
                    self.checked("actuator.lag", lag, ok, &allowed)?
                }
            },
        })
    }

    /// A drive reckons with a delay of some control periods.
    pub(super) fn delay_of_a_drive(&self, raw: &RawActuator, sample_time: f64) -> Result<()> {
        let Some(delay) = &raw.delay else {
            return Ok(());
        };
        let most = MOST_PERIODS * sample_time;
        let ok = *delay.get_ref() <= most;
        let allowed = format!("at most {MOST_PERIODS} control periods, {most} s, in a drive file");
        self.checked("actuator.delay", delay, ok, &allowed)?;
        Ok(())
    }

    pub(super) fn encoder(&self, raw: &RawEncoder) -> Result<Encoder> {
        let resolution = self.positive(
            "encoder.resolution",
            &raw.resolution,
            &format!("{} per count", self.units().position),
        )?;
        let bits = *raw.counter_bits.get_ref();
        let Some(counter_bits) = u32::try_from(bits)
            .ok()
            .filter(|bits| (2..=32).contains(bits))
        else {
            let message = format!("encoder.counter_bits = {bits}: must be 2 to 32");
            return Err(self.error(Some(raw.counter_bits.span()), message));
        };
        Ok(Encoder {
            resolution,
            counter_bits,
        })
    }

    pub(super) fn loads(&self, raw: &RawFile) -> Result<Vec<Load>> {
        let count = raw.load.len();
        if !(1..=MAX_LOADS).contains(&count) {
            let span = raw.load.get(MAX_LOADS).map(Spanned::span);
            let message = format!("{count} [[load]] tables: must be 1 to {MAX_LOADS}");
            return Err(self.error(span, message));
        }
        let units = self.units();
        let loads = raw.load.iter().enumerate();
        loads
            .map(|(i, load)| {
                let load = load.get_ref();
                let key = |name: &str| format!("load[{}].{name}", i + 1);
                Ok(Load {
                    mass: self.positive(&key("mass"), &load.mass, units.mass)?,
                    stiffness: self.positive(
                        &key("stiffness"),
                        &load.stiffness,
                        units.stiffness,
                    )?,
                    damping: self.positive(&key("damping"), &load.damping, units.damping)?,
                    viscous: self.not_negative(
                        &key("viscous"),
                        load.viscous.as_ref(),
                        units.damping,
                    )?,
                    coulomb: self.not_negative(
                        &key("coulomb"),
                        load.coulomb.as_ref(),
                        units.force,
                    )?,
                })
            })
            .collect()
    }

    /// Friction on the actuator; none where the file has no table.
    pub(super) fn friction(&self, raw: Option<&RawFriction>) -> Result<Friction> {
        let Some(raw) = raw else {
            return Ok(Friction::default());
        };
        let units = self.units();
        let value =
            |key: &str, value: &Option<Number>, unit| self.not_negative(key, value.as_ref(), unit);
        let coulomb = value("friction.coulomb", &raw.coulomb, units.force)?;
        Ok(Friction {
            coulomb,
            coulomb_backward: match &raw.coulomb_backward {
                None => None,
                backward => Some(value("friction.coulomb_backward", backward, units.force)?),
            },
            breakaway: match &raw.at_rest {
                None => 0.0,
                Some(number) => {
                    let ok = (coulomb..=LARGEST).contains(number.get_ref());
                    let allowed = format!(
                        "from friction.coulomb = {coulomb} to {LARGEST:e} {}",
                        units.force
                    );
                    self.checked("friction.static", number, ok, &allowed)? - coulomb
                }
            },
            stribeck_velocity: match &raw.stribeck_velocity {
                None => STRIBECK_VELOCITY,
                Some(number) => {
                    self.positive("friction.stribeck_velocity", number, units.velocity)?
                }
            },
            viscous: value("friction.viscous", &raw.viscous, units.damping)?,
        })
    }

    /// What a plant alone has.
    pub(super) fn imperfections(&self, raw: &RawFile) -> Result<Imperfections> {
        let units = self.units();
        let (actuator, encoder) = (&raw.actuator, &raw.encoder);
        let loads = raw.load.iter().enumerate();
        let backlash = loads.map(|(i, load)| {
            let key = format!("load[{}].backlash", i + 1);
            self.not_negative(&key, load.get_ref().backlash.as_ref(), units.position)
        });
        Ok(Imperfections {
            cogging: self.wave(
                ("actuator.cogging", &actuator.cogging, units.force),
                ("actuator.cogging_pitch", &actuator.cogging_pitch),
            )?,
            backlash: backlash.collect::<Result<_>>()?,
            eccentricity: self.wave(
                (
                    "encoder.eccentricity",
                    &encoder.eccentricity,
                    units.position,
                ),
                ("encoder.eccentricity_pitch", &encoder.eccentricity_pitch),
            )?,
            noise: self.not_negative("encoder.noise", encoder.noise.as_ref(), units.position)?,
        })
    }

    /// An amplitude and its pitch: both or neither.
    fn wave(
        &self,
        (key, amplitude, unit): (&str, &Option<Number>, &str),
        (pitch_key, pitch): (&str, &Option<Number>),
    ) -> Result<Wave> {
        let needs = |number: &Number, key: &str, other: &str| {
            let message = format!("{key} = {}: needs {other} as well", number.get_ref());
            Err(self.error(Some(number.span()), message))
        };
        match (amplitude, pitch) {
            (None, None) => Ok(Wave::default()),
            (Some(amplitude), None) => needs(amplitude, key, pitch_key),
            (None, Some(pitch)) => needs(pitch, pitch_key, key),
            (Some(_), Some(pitch)) => Ok(Wave {
                amplitude: self.not_negative(key, amplitude.as_ref(), unit)?,
                pitch: self.positive(pitch_key, pitch, self.units().position)?,
            }),
        }
    }

    pub(super) fn force(
        &self,
        number: usize,
        raw: &RawForce,
        loads: usize,
    ) -> Result<ExternalForce> {
        let key = |name: &str| format!("force[{number}].{name}");
        let mass = *raw.mass.get_ref();
        let Some(mass) = usize::try_from(mass).ok().filter(|mass| *mass <= loads) else {
            let message = format!("{} = {mass}: must be 0 (actuator) to {loads}", key("mass"));
            return Err(self.error(Some(raw.mass.span()), message));
        };
        let newton = *raw.newton.get_ref();
        let ok = newton.abs() <= LARGEST;
        Ok(ExternalForce {
            mass,
            start: self.not_negative(&key("start"), Some(&raw.start), "s")?,
            duration: self.not_negative(&key("duration"), Some(&raw.duration), "s")?,
            newton: self.checked(
                &key("newton"),
                &raw.newton,
                ok,
                &format!("within {LARGEST:e} {}", self.units().force),
            )?,
        })
    }
}
