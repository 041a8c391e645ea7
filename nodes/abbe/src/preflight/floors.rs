//! The noise that a forecast assumes, until repeats have shown what it is.

use anyhow::Result;
use gap_diagnosis::preflight::{AssumedFloor, FLOOR_UM, Floors};
use machine::MachineFile;
use twin::Instrument;

/// Instruments with the noise of a reading that is assumed unless something else is said, µm.
const READING_UM: [(Instrument, f64); 6] = [
    (Instrument::Motor, 0.1),
    (Instrument::Scale, 0.1),
    (Instrument::Grid, 0.1),
    (Instrument::Radial, 0.1),
    (Instrument::Length, 0.1),
    (Instrument::Touch, 0.5),
];
/// Smooth deviation between runs that is assumed unless something else is said, µm: what machining centres
/// in good repair show from run to run lies between a tenth and a half.
const BETWEEN_RUNS_UM: f64 = 0.3;

/// A floor as the command line has it: `grid=0.1/0.3`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorArgument {
    instrument: Instrument,
    floor: AssumedFloor,
}

impl FloorArgument {
    /// The instrument whose noise it states.
    pub const fn instrument(&self) -> Instrument {
        self.instrument
    }
}

/// Reads `INSTRUMENT=READING/BETWEEN` in µm.
///
/// # Errors
/// Says what of it cannot be read.
pub fn argument(text: &str) -> Result<FloorArgument, String> {
    let [least, greatest] = FLOOR_UM;
    let form = || {
        format!(
            "--floor \"{text}\": INSTRUMENT=READING/BETWEEN in µm is needed, each from {least} to {greatest}, e.g. grid=0.1/0.3"
        )
    };
    let (name, values) = text.split_once('=').ok_or_else(form)?;
    let (reading, between) = values.split_once('/').ok_or_else(form)?;
    let known = READING_UM.map(|(instrument, _)| instrument);
    let instrument = known
        .into_iter()
        .find(|instrument| instrument.to_string() == name)
        .ok_or_else(|| {
            let names = known.map(|instrument| instrument.to_string());
            format!(
                "--floor \"{name}\" is no instrument (known: {})",
                names.join(", ")
            )
        })?;
    Ok(FloorArgument {
        instrument,
        floor: AssumedFloor {
            reading_um: micrometres(&format!("{name}, reading"), reading)?,
            between_runs_um: micrometres(&format!("{name}, between runs"), between)?,
        },
    })
}

/// A noise in µm that an instrument can have; readings are weighted by its inverse square.
fn micrometres(place: &str, part: &str) -> Result<f64, String> {
    let [least, greatest] = FLOOR_UM;
    let value = part.trim().parse::<f64>().ok();
    let value = value.filter(|value| (least..=greatest).contains(value));
    value.ok_or_else(|| {
        format!(
            "--floor {place} = \"{part}\": must be a number from {least} to {greatest} µm, e.g. grid=0.1/0.3"
        )
    })
}

/// Refuses an instrument that is named twice.
///
/// # Errors
/// Names it.
pub fn check(said: &[FloorArgument]) -> Result<(), String> {
    for (k, one) in said.iter().enumerate() {
        if said[..k]
            .iter()
            .any(|before| before.instrument == one.instrument)
        {
            return Err(format!(
                "--floor {} is given twice: give it once",
                one.instrument
            ));
        }
    }
    Ok(())
}

/// Floors of all instruments: those said, else the probe's repeatability of the machine file and the usual.
pub fn floors(machine: &MachineFile, said: &[FloorArgument]) -> Floors {
    let usual = READING_UM.into_iter().map(|(instrument, reading_um)| {
        let of_file = machine.probe.repeatability_um;
        let is_probe = instrument == Instrument::Touch && of_file > 0.0;
        let floor = AssumedFloor {
            reading_um: if is_probe { of_file } else { reading_um },
            between_runs_um: BETWEEN_RUNS_UM,
        };
        (instrument, floor)
    });
    let mut floors: Floors = usual.collect();
    floors.extend(said.iter().map(|one| (one.instrument, one.floor)));
    floors
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_floor_names_an_instrument_and_two_numbers() {
        let grid = argument("grid=0.2/0.5").unwrap();
        assert_eq!(grid.instrument, Instrument::Grid);
        assert_eq!(
            grid.floor,
            AssumedFloor {
                reading_um: 0.2,
                between_runs_um: 0.5
            }
        );
        for (text, word) in [
            ("grid", "INSTRUMENT=READING/BETWEEN"),
            ("grid=0.2", "INSTRUMENT=READING/BETWEEN"),
            ("plate=0.2/0.5", "known: motor, scale, grid"),
            (
                "grid=-1/0.5",
                "--floor grid, reading = \"-1\": must be a number from 0.0001",
            ),
            ("grid=0.1/x", "--floor grid, between runs = \"x\""),
            (
                "motor=1e-300",
                "--floor \"motor=1e-300\": INSTRUMENT=READING/BETWEEN",
            ),
            (
                "motor=1e-300/0.1",
                "reading = \"1e-300\": must be a number from 0.0001 to 10000 µm",
            ),
            ("motor=0.1/nan", "between runs = \"nan\""),
            ("touch=inf/0.1", "touch, reading = \"inf\""),
            ("touch=1e25/0.1", "touch, reading = \"1e25\""),
        ] {
            let error = argument(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }

    #[test]
    fn the_probes_repeatability_is_that_of_the_machine_file() {
        const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");
        let machine = MachineFile::parse(MACHINE, "m").unwrap();
        let floors = floors(&machine, &[argument("length=0.02/0.1").unwrap()]);
        let reading = |instrument| floors[&instrument].reading_um;
        assert!((reading(Instrument::Touch) - 0.3).abs() < 1e-12);
        assert!((reading(Instrument::Length) - 0.02).abs() < 1e-12);
    }
}
