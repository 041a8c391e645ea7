//! An exported compensation file takes a screw's errors out of a real control, and doubles them with the wrong sign.
//!
//! The errors stand in the scenario's HAL file, which nothing but LinuxCNC reads: a lead error, a thread error
//! between knots that are no points of the table, and lost motion. The table is made from what the slide was measured to do; at
//! every other stop nothing was in the table. The slide is sampled at 1 kHz by the servo thread. Files of type 1 are tried
//! here; those of type 0 by the scenario itself, which makes them of its own run (`tests/linuxcnc`).

use std::path::Path;

use control_tables::linuxcnc::{FileType, compensation_file};
use control_tables::{AxisErrors, ExportFile};
use linuxcnc_bridge::run::Outcome;
use metrology::Axis;
use metrology::sample::AxisState;
use test_namespaces::isolated;

use crate::linuxcnc::rig::{Rig, read, scenario};

/// A stop counts when the command has stood still for so many samples; the last ones are averaged.
const STILL_SAMPLES: usize = 250;
const AVERAGED_SAMPLES: usize = 100;
/// Stops of the program in each direction, the first and last entered from outside.
const STOPS: usize = 41;

/// Where the slide stood.
#[derive(Clone, Copy)]
struct Stop {
    command_mm: f64,
    slide_mm: f64,
    up: bool,
}

impl Stop {
    fn error_mm(&self) -> f64 {
        self.slide_mm - self.command_mm
    }
}

/// Stops between -300 and 300 mm that were entered by a motion.
fn stops(states: &[AxisState]) -> Vec<Stop> {
    let command = |state: &AxisState| state.commanded[Axis::X];
    let still = states.chunk_by(|a, b| (command(a) - command(b)).abs() < 1e-9);
    // The sample before a standstill tells from where it was entered; the first has none and is no stop.
    let mut before_mm = None;
    let mut found = Vec::new();
    for samples in still {
        let command_mm = command(&samples[0]);
        let from_mm = before_mm.replace(command_mm);
        let (Some(from_mm), true) = (from_mm, samples.len() >= STILL_SAMPLES) else {
            continue;
        };
        let last = &samples[samples.len() - AVERAGED_SAMPLES..];
        let sum_mm: f64 = last.iter().map(|state| state.motor[Axis::X]).sum();
        found.push(Stop {
            command_mm,
            slide_mm: sum_mm / AVERAGED_SAMPLES as f64,
            up: command_mm > from_mm,
        });
    }
    found
}

/// On a busy computer the sampler may lose records, and a stop with them: the program is run again for those that are missing.
const ATTEMPTS: u32 = 3;

/// Runs the scenario's program on a LinuxCNC that loads `file`; `None` where LinuxCNC is not installed.
fn measure(file: Option<(&ExportFile, FileType)>) -> Option<Vec<Stop>> {
    let source = scenario("linuxcnc_screw_error");
    let folder = tempfile::tempdir().unwrap();
    for part in ["", "controller"] {
        let to = folder.path().join(part);
        std::fs::create_dir_all(&to).unwrap();
        for entry in std::fs::read_dir(source.join(part)).unwrap() {
            let entry = entry.unwrap();
            if entry.path().is_file() {
                std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
            }
        }
    }
    if let Some((file, file_type)) = file {
        load(&folder.path().join("controller"), file, file_type);
    }
    let mut rig = Rig::of_folder(folder.path())?;
    let inside = |stop: &Stop| (-300.5..=300.5).contains(&stop.command_mm);
    let mut all = Vec::new();
    for attempt in 1..=ATTEMPTS {
        rig.states.clear();
        let ending = rig.run(&read(&source.join("positions.ngc")));
        assert_eq!(ending.outcome, Outcome::Done, "{}", ending.message);
        all.extend(stops(&rig.states).into_iter().filter(inside));
        let (up, down): (Vec<Stop>, Vec<Stop>) = all.iter().copied().partition(|stop| stop.up);
        let (up, down) = (ascending(up), ascending(down));
        if (up.len(), down.len()) == (STOPS, STOPS) {
            return Some(up.into_iter().chain(down).collect());
        }
        let (n_up, n_down) = (up.len(), down.len());
        println!("attempt {attempt}: {n_up} and {n_down} of {STOPS} stops were sampled");
    }
    panic!("samples of a stop were lost in each of {ATTEMPTS} attempts");
}

/// The first stop at each position, in order of positions; the last stop of all is the way home.
fn ascending(mut stops: Vec<Stop>) -> Vec<Stop> {
    stops.sort_by(|a, b| a.command_mm.total_cmp(&b.command_mm));
    stops.dedup_by(|later, first| (later.command_mm - first.command_mm).abs() < 1e-6);
    stops
}

fn load(controller: &Path, file: &ExportFile, file_type: FileType) {
    let path = controller.join("screw_error.ini");
    let ini = read(&path);
    assert!(ini.contains(&format!("COMP_FILE = {}\n", file.name)));
    let told = format!("COMP_FILE_TYPE = {}\n", file_type.number());
    std::fs::write(&path, ini.replace("COMP_FILE_TYPE = 0\n", &told)).unwrap();
    std::fs::write(controller.join(&file.name), &file.text).unwrap();
}

/// The table of every other stop, times `sign`.
fn table(stops: &[Stop], sign: f64) -> AxisErrors {
    let every_other = |up: bool| stops.iter().filter(move |stop| stop.up == up).step_by(2);
    let errors = |up| every_other(up).map(|stop| sign * stop.error_mm()).collect();
    let position = every_other(true).map(|stop| stop.command_mm).collect();
    AxisErrors::new(Axis::X, position, errors(true), errors(false)).unwrap()
}

fn greatest_um(stops: &[Stop]) -> f64 {
    let sizes = stops.iter().map(|stop| stop.error_mm().abs() * 1e3);
    sizes.fold(0.0, f64::max)
}

fn rms_um(stops: &[Stop]) -> f64 {
    let sum: f64 = stops.iter().map(|stop| stop.error_mm().powi(2)).sum();
    (sum / stops.len() as f64).sqrt() * 1e3
}

#[test]
fn val_linuxcnc_an_exported_file_removes_nine_tenths_of_the_screws_error_and_the_wrong_sign_doubles_it()
 {
    isolated(|| {
        let Some(bare) = measure(None) else {
            return;
        };
        let (bare_um, bare_rms_um) = (greatest_um(&bare), rms_um(&bare));
        println!("no compensation: at most {bare_um:.2} um, rms {bare_rms_um:.2} um");
        assert!(bare_um > 30.0, "the scenario has a screw with errors");
        let right = compensation_file(&table(&bare, 1.0), FileType::Offset).unwrap();
        let corrected = measure(Some((&right, FileType::Offset))).unwrap();
        let (greatest, rms) = (greatest_um(&corrected), rms_um(&corrected));
        println!("type 1: at most {greatest:.3} um, rms {rms:.3} um");
        assert!(greatest < 0.1 * bare_um, "{greatest} um");
        assert!(rms < 0.1 * bare_rms_um, "{rms} um");

        let wrong = compensation_file(&table(&bare, -1.0), FileType::Offset).unwrap();
        let doubled = measure(Some((&wrong, FileType::Offset))).unwrap();
        let ratio = rms_um(&doubled) / bare_rms_um;
        let greatest = greatest_um(&doubled);
        println!("type 1, sign turned round: at most {greatest:.2} um, rms times {ratio:.3}");
        assert!((1.9..2.1).contains(&ratio), "{ratio}");
    });
}
