//! What a shop has: instruments by the words of the command line, and the time that each takes to put up.

use std::collections::BTreeMap;
use std::fmt;

use gap_diagnosis::preflight::Floors;
use machine::MachineFile;
use metrology::number::number;
use twin::Instrument;

/// Something that measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Means {
    /// The touch probe.
    Probe,
    /// The plane grid encoder.
    Grid,
    /// The length reference: a laser interferometer.
    Laser,
    /// A ballbar.
    Ballbar,
    /// The linear scales of the machine.
    Scales,
    /// The thermometers of the machine file.
    Thermometers,
}

/// Each with its word and the usual time of one set-up, min.
const ALL: [(Means, &str, f64); 6] = [
    (Means::Probe, "probe", 1.0),
    (Means::Grid, "grid", 6.0),
    (Means::Laser, "laser", 8.0),
    (Means::Ballbar, "ballbar", 4.0),
    (Means::Scales, "scales", 0.0),
    (Means::Thermometers, "thermometers", 0.0),
];
/// Longest time of a set-up, min.
const MOST_MIN: f64 = 240.0;

impl fmt::Display for Means {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = ALL.iter().find(|(means, ..)| means == self);
        f.write_str(word.map_or("", |(_, word, _)| word))
    }
}

/// Reads the word of an instrument.
///
/// # Errors
/// Names the words that there are.
pub fn means(text: &str) -> Result<Means, String> {
    let found = ALL.iter().find(|(_, word, _)| *word == text.trim());
    found.map(|(means, ..)| *means).ok_or_else(|| {
        let words = ALL.map(|(_, word, _)| word);
        format!("\"{text}\" is no instrument (known: {})", words.join(", "))
    })
}

/// The time of a set-up as the command line has it: `laser=12`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    means: Means,
    minutes: f64,
}

/// Reads `INSTRUMENT=MIN`.
///
/// # Errors
/// Says what of it cannot be read.
pub fn mounting(text: &str) -> Result<Mounting, String> {
    let form = || format!("\"{text}\": INSTRUMENT=MIN is needed, e.g. laser=12");
    let (name, minutes) = text.split_once('=').ok_or_else(form)?;
    let means = means(name)?;
    let value: f64 = minutes
        .trim()
        .parse()
        .map_err(|_| format!("\"{minutes}\" is no number of minutes"))?;
    if !(0.0..=MOST_MIN).contains(&value) {
        return Err(format!(
            "{name}={}: must be from 0 to {} min",
            number(value),
            number(MOST_MIN)
        ));
    }
    Ok(Mounting {
        means,
        minutes: value,
    })
}

/// What is at hand, each once, and the time of one set-up of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Shop {
    at_hand: Vec<Means>,
    minutes: BTreeMap<Means, f64>,
}

impl Shop {
    /// The instruments of the command line on a machine.
    ///
    /// # Errors
    /// Names one that is given twice or that the machine file does not have, with the remedy.
    pub fn new(
        with: &[Means],
        mountings: &[Mounting],
        machine: &MachineFile,
    ) -> Result<Self, String> {
        let mut minutes: BTreeMap<Means, f64> = ALL.map(|(means, _, min)| (means, min)).into();
        for (k, means) in with.iter().enumerate() {
            if with[..k].contains(means) {
                return Err(format!("--with {means} is given twice: give it once"));
            }
            if let Some(lack) = lack(*means, machine) {
                return Err(format!("--with {means}: the machine file has no {lack}"));
            }
        }
        for (k, one) in mountings.iter().enumerate() {
            if mountings[..k]
                .iter()
                .any(|before| before.means == one.means)
            {
                return Err(format!(
                    "--mounting {} is given twice: give it once",
                    one.means
                ));
            }
            let _ = minutes.insert(one.means, one.minutes);
        }
        Ok(Self {
            at_hand: with.to_vec(),
            minutes,
        })
    }

    /// Whether an instrument is at hand.
    pub fn has(&self, means: Means) -> bool {
        self.at_hand.contains(&means)
    }

    /// Time of one set-up, min.
    pub fn minutes(&self, means: Means) -> f64 {
        self.minutes.get(&means).copied().unwrap_or(0.0)
    }

    /// What is stated of an instrument that is not at hand, and what it then is good for; `floored`: instruments whose noise
    /// is stated, `offered`: instruments of the tests of this machine.
    pub fn beside(
        &self,
        mountings: &[Mounting],
        floored: &[Instrument],
        offered: &[Means],
    ) -> Vec<String> {
        let mounted = mountings
            .iter()
            .map(|one| (format!("--mounting {}", one.means), one.means));
        let floors = floored.iter().filter_map(|instrument| {
            Some((format!("--floor {instrument}"), read_by(*instrument)?))
        });
        let of = |(option, means): (String, Means)| {
            let is_of_a_test = offered.contains(&means);
            if self.has(means) && (is_of_a_test || option.starts_with("--floor")) {
                None
            } else if is_of_a_test {
                Some(format!(
                    "{option}: --with does not name {means}: it counts only for tests that other instruments would add."
                ))
            } else if self.has(means) {
                Some(format!(
                    "{option} has no effect: no test is set up with {means}."
                ))
            } else {
                Some(format!(
                    "{option} has no effect: --with does not name {means}, and no test of this machine needs it."
                ))
            }
        };
        mounted.chain(floors).filter_map(of).collect()
    }

    /// Floors of what can be read: motor encoders always, scales where they are at hand, every other instrument for tests
    /// that would need it.
    pub fn read(&self, mut floors: Floors) -> Floors {
        if !self.has(Means::Scales) {
            let _ = floors.remove(&Instrument::Scale);
        }
        floors
    }

    /// The machine as this shop can read it: thermometers that are not at hand say nothing.
    pub fn equipped(&self, machine: &MachineFile) -> MachineFile {
        let mut equipped = machine.clone();
        if !self.has(Means::Thermometers) {
            equipped.temperature_sensors.clear();
        }
        equipped
    }
}

/// What a shop has to have for an instrument of a bag; none: every machine has it.
const fn read_by(instrument: Instrument) -> Option<Means> {
    match instrument {
        Instrument::Motor => None,
        Instrument::Scale => Some(Means::Scales),
        Instrument::Grid => Some(Means::Grid),
        Instrument::Radial => Some(Means::Ballbar),
        Instrument::Length => Some(Means::Laser),
        Instrument::Touch => Some(Means::Probe),
        Instrument::Thermometer => Some(Means::Thermometers),
    }
}

/// What a machine file lacks for an instrument, with the key to add.
fn lack(means: Means, machine: &MachineFile) -> Option<&'static str> {
    let has_scale = machine.axes.keys().any(|axis| {
        let linear = machine.linear(*axis);
        linear.is_some_and(|entry| entry.scale_resolution_um.is_some())
    });
    let (has, lack) = match means {
        Means::Probe => (
            !machine.blocks.is_empty() || !machine.artefacts.is_empty(),
            "blocks and no artefacts to touch: add them",
        ),
        Means::Grid => (
            machine.grid_encoder.is_some(),
            "grid_encoder: add it with its placements",
        ),
        Means::Laser => (
            machine.length_reference.is_some(),
            "length_reference: add it with its beams",
        ),
        Means::Ballbar => (true, ""),
        Means::Scales => (has_scale, "axis with scale_resolution_um: add the key"),
        Means::Thermometers => (
            !machine.temperature_sensors.is_empty(),
            "temperature_sensors: add them",
        ),
    };
    (!has).then_some(lack)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GAP_FIRST: &str = include_str!("../../../../../launch_configs/gap_first/machine.yaml");

    #[test]
    fn what_is_no_instrument_is_refused_with_those_that_are() {
        assert_eq!(means(" laser"), Ok(Means::Laser));
        let wrong = means("theodolite").unwrap_err();
        assert!(wrong.contains("\"theodolite\" is no instrument (known: probe, grid"));
        assert!(mounting("grid").unwrap_err().contains("INSTRUMENT=MIN"));
        assert!(mounting("grid=-1").unwrap_err().contains("from 0 to 240"));
        assert!(mounting("grid=nan").unwrap_err().contains("from 0 to 240"));
        assert!(mounting("plate=3").unwrap_err().contains("plate"));
    }

    #[test]
    fn what_the_machine_file_lacks_is_named_with_its_key() {
        let machine = MachineFile::parse(GAP_FIRST, "machine.yaml").unwrap();
        let of = |with: &[Means]| Shop::new(with, &[], &machine);
        assert!(of(&[Means::Grid, Means::Probe, Means::Ballbar]).is_ok());
        let scales = of(&[Means::Scales]).unwrap_err();
        assert!(scales.contains("scale_resolution_um"), "{scales}");
        let twice = of(&[Means::Grid, Means::Grid]).unwrap_err();
        assert!(twice.contains("given twice"), "{twice}");
        let laser = [mounting("laser=12").unwrap()];
        let shop = Shop::new(&[Means::Laser], &laser, &machine).unwrap();
        assert!((shop.minutes(Means::Laser) - 12.0).abs() < 1e-12);
        assert!(shop.equipped(&machine).temperature_sensors.is_empty());
    }

    #[test]
    fn what_is_stated_of_an_instrument_that_is_not_at_hand_is_reported() {
        let machine = MachineFile::parse(GAP_FIRST, "machine.yaml").unwrap();
        let mountings = [mounting("laser=5").unwrap(), mounting("probe=2").unwrap()];
        let shop = Shop::new(&[Means::Probe], &mountings, &machine).unwrap();
        let floored = [Instrument::Grid, Instrument::Touch, Instrument::Motor];
        let said = shop.beside(&mountings, &floored, &[Means::Probe, Means::Grid]);
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(
            said[0].starts_with("--mounting laser has no effect"),
            "{said:?}"
        );
        assert!(
            said[1].starts_with("--floor grid: --with does not name grid"),
            "{said:?}"
        );
        let scales = mounting("scales=5").unwrap();
        let none = shop.beside(&[scales], &[], &[Means::Probe]);
        assert!(none[0].contains("has no effect"), "{none:?}");
    }
}
