//! The tables that say what a machine is made of: actuator, encoder, loads, friction, forces.

use super::MAX_LOADS;
use super::document::{Document, LARGEST, SMALLEST};
use super::schema::{
    Number, RawActuator, RawAmplifier, RawEncoder, RawFile, RawForce, RawFriction,
};
use crate::error::Result;
use crate::machine::{Actuator, Encoder, ExternalForce, Friction, Load};
use toml::Spanned;

/// The middle of twelve bits.
const MIDDLE: u16 = 2048;

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
            delay: 0.0,
            lag: 0.0,
        })
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
                    viscous: 0.0,
                    coulomb: 0.0,
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
        Ok(Friction {
            coulomb: value("friction.coulomb", &raw.coulomb, units.force)?,
            coulomb_backward: None,
            breakaway: 0.0,
            stribeck_velocity: 0.0,
            viscous: value("friction.viscous", &raw.viscous, units.damping)?,
        })
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
