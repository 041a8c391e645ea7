//! A machine of which nothing is stated but what a table shows: axes, travels, thermometers.

use std::fmt::Write;

use metrology::Axis;

use super::map::{Map, Test};

/// Name of the machine that a table is evaluated on where none is stated.
pub const NO_MACHINE: &str = "not_stated";

/// Travel that holds any table, mm.
const ANY_TRAVEL_MM: [f64; 2] = [-100_000.0, 100_000.0];

/// Words in names of thermometers, with the place that they are at; the first that is found counts.
const PLACES_BY_WORD: [(&str, &str); 16] = [
    ("spindle_rear", "spindle_rear"),
    ("rear", "spindle_rear"),
    ("spindle", "spindle_front"),
    ("nose", "spindle_front"),
    ("head", "spindle_front"),
    ("column", "column"),
    ("bed", "bed"),
    ("base", "bed"),
    ("table", "bed"),
    ("nut_x", "nut_x"),
    ("screw_x", "nut_x"),
    ("nut_y", "nut_y"),
    ("screw_y", "nut_y"),
    ("nut_z", "nut_z"),
    ("screw_z", "nut_z"),
    ("ambient", UNKNOWN_PLACE),
];
/// The place of a thermometer whose name has none.
pub const UNKNOWN_PLACE: &str = "ambient";

/// Such a machine.
pub struct PlainMachine {
    /// Its name.
    pub name: &'static str,
    /// Travels of X, Y and Z, mm.
    pub travels_mm: [[f64; 2]; 3],
    /// Rotary axes, whose tables lie on one another, the first below.
    pub rotary: Vec<Axis>,
    /// Thermometers with the places that they are at.
    pub sensors: Vec<(String, &'static str)>,
}

impl PlainMachine {
    /// One that is wide enough for any table that a map describes.
    pub fn of_map(map: &Map) -> Self {
        let (axis, sensors) = match &map.test {
            Test::Positioning { axis, .. } => (*axis, vec![]),
            Test::Circle { .. } | Test::Touches { .. } => (Axis::X, vec![]),
            Test::Log {
                axis,
                temperature_degc,
                ..
            } => (*axis, temperature_degc.keys().cloned().collect()),
        };
        Self {
            name: NO_MACHINE,
            travels_mm: [ANY_TRAVEL_MM; 3],
            rotary: Some(axis)
                .filter(|axis| !axis.is_linear())
                .into_iter()
                .collect(),
            sensors: { sensors.into_iter() }
                .map(|id: String| (id, UNKNOWN_PLACE))
                .collect(),
        }
    }

    /// Its machine file.
    pub fn text(&self) -> String {
        let rotary = "{travel_deg: [-3600.0, 3600.0], feed_limit_deg_min: 1000000.0, acceleration_limit_deg_s2: 1000.0, position_gain_per_s: 40.0, velocity_feedforward: 0.98, encoder_resolution_arcsec: 0.1}";
        let tables: String = self
            .rotary
            .iter()
            .rev()
            .map(|axis| format!(" {axis}'"))
            .collect();
        let mut text = format!(
            "name: {}\nchain: \"[w{tables} X' Y' b Z t]\"\naxes:\n",
            self.name
        );
        // Writing to a String never fails.
        for (axis, [least, greatest]) in Axis::LINEAR.iter().zip(self.travels_mm) {
            let _ = writeln!(
                text,
                "  {axis}: {{travel_mm: [{least:?}, {greatest:?}], feed_limit_mm_min: 1000000.0}}"
            );
        }
        for axis in &self.rotary {
            let _ = writeln!(text, "  {axis}: {rotary}");
        }
        if !self.rotary.is_empty() {
            text.push_str("rotary:\n  origin_mm:\n");
        }
        for axis in &self.rotary {
            let _ = writeln!(text, "    {axis}: [0.0, 0.0, 0.0]");
        }
        if !self.sensors.is_empty() {
            text.push_str("temperature_sensors:\n");
        }
        for (id, place) in &self.sensors {
            let _ = writeln!(text, "  - {{id: {id}, place: {place}, period_s: 10.0}}");
        }
        text
    }
}

/// The place that a thermometer's name tells; `None`: none.
pub fn place_in_name(id: &str) -> Option<&'static str> {
    let id = id.to_lowercase().replace(['-', ' '], "_");
    let known = PLACES_BY_WORD.iter().find(|(word, _)| id.contains(word));
    known.map(|(_, place)| *place)
}

#[cfg(test)]
mod tests {
    use machine::MachineFile;

    use super::*;

    #[test]
    fn a_plain_machine_is_a_machine_file_with_its_axes_and_thermometers() {
        let plain = PlainMachine {
            name: "mill",
            travels_mm: [[-10.0, 510.0], [-250.0, 250.0], [0.0, 400.0]],
            rotary: vec![Axis::A, Axis::C],
            sensors: vec![("rear_bearing".to_owned(), "spindle_rear")],
        };
        let machine = MachineFile::parse(&plain.text(), "machine.yaml").unwrap();
        assert_eq!(machine.axes.len(), 5);
        assert_eq!(machine.linear(Axis::X).unwrap().travel_mm, [-10.0, 510.0]);
        assert_eq!(machine.temperature_sensors[0].id, "rear_bearing");
    }

    #[test]
    fn names_of_thermometers_tell_places() {
        for (id, place) in [
            ("spindle_front", Some("spindle_front")),
            ("Spindle rear", Some("spindle_rear")),
            ("T_column", Some("column")),
            ("nut_y", Some("nut_y")),
            ("screw-Z", Some("nut_z")),
            ("ambient_2", Some("ambient")),
            ("T7", None),
        ] {
            assert_eq!(place_in_name(id), place, "{id}");
        }
    }
}
