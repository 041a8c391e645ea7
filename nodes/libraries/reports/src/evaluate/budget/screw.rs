//! What a budget states of ball screws.
//!
//! A motor encoder counts turns of the screw, so that the screw between its fixed bearing and the nut carries the positions: at
//! θ it is longer by α_s (θ_s − 20 °C) of them. ISO 230-2 takes the nominal differential expansion of the positioning system,
//! which is then the screw. A linear scale that closes the position loop, or from which a table was learned, carries them in
//! its stead.

use metrology::Axis;
use metrology::number::quantity;

use super::{Body, Budget, greatest};

impl Budget {
    /// With the ball screw of an axis in the place of the machine; none where the budget states no screw of it.
    #[must_use]
    pub fn of_screw(&self, axis: Axis) -> Option<Self> {
        let screw = self.screws.get(&axis)?;
        let mut own = self.clone();
        own.machine = Some(screw.clone());
        Some(own)
    }

    /// Thermometers of the ball screw of an axis; none where the budget states no screw of it.
    #[must_use]
    pub fn thermometers_of_screw(&self, axis: Axis) -> &[String] {
        let screw = self.screws.get(&axis);
        screw.map_or(&[], |screw| &screw.thermometers)
    }

    /// Every screw with its name.
    pub(super) fn screws(&self) -> impl Iterator<Item = (String, &Body)> {
        let all = self.screws.iter();
        all.map(|(axis, body)| (format!("screws.{axis}"), body))
    }

    /// Refuses a screw of a rotary axis, and numbers out of their range.
    pub(super) fn check_screws(&self) -> Result<(), String> {
        if let Some(axis) = self.screws.keys().find(|axis| !axis.is_linear()) {
            return Err(format!("screws.{axis}: must be a linear axis, X, Y or Z"));
        }
        for (name, body) in self.screws() {
            body.check()
                .map_err(|(key, rule)| format!("{name}.{key}{rule}"))?;
            for (key, value) in body.numbers() {
                let most = greatest(key);
                if !(0.0..=most).contains(&value) {
                    let [value, most] = [value, most].map(|one| quantity(key, one));
                    return Err(format!("{name}.{key} = {value}: must be from 0 to {most}"));
                }
            }
        }
        Ok(())
    }
}

impl Body {
    /// Its numbers above 0 by their keys.
    pub(super) const fn numbers(&self) -> [(&'static str, f64); 3] {
        [
            ("temperature_half_width_k", self.temperature_half_width_k),
            ("expansion_um_per_m_k", self.expansion_um_per_m_k),
            (
                "expansion_half_width_um_per_m_k",
                self.expansion_half_width_um_per_m_k,
            ),
        ]
    }
}
