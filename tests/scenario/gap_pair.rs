//! Two effects that a poor programme cannot tell apart: `abbe diagnose` reports them as a set and says what to measure;
//! with the bag of that measurement beside the first ones, one of them is named.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use abbe_tests::program::{Process, command, root};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use tempfile::TempDir;

const MACHINE: &str = "launch_configs/gap_first/machine.yaml";
/// X and Y are off square by this much.
const SQUARENESS_URAD: f64 = 20.0;
/// Noise of a reading, and of each harmonic of what a run has of its own, µm.
const READING_UM: f64 = 0.1;
const RUN_UM: f64 = 0.07;

/// A ballbar of a machine that is off square, run three times in each sense, as a bag.
struct Ballbar {
    home: TempDir,
    noise: Pcg64Mcg,
}

impl Ballbar {
    fn normal(&mut self, size: f64) -> f64 {
        let normal: f64 = StandardNormal.sample(&mut self.noise);
        size * normal
    }

    fn table(&mut self, radius_mm: f64, senses: &[f64]) -> String {
        let mut table = String::from("run,angle_deg,radial_um\n");
        let runs = (0..3).flat_map(|_| senses.iter().copied());
        for (run, sense) in runs.enumerate() {
            let own: [f64; 4] = std::array::from_fn(|_| self.normal(RUN_UM));
            for step in 0..=360 {
                let degrees = if sense > 0.0 { step } else { 360 - step };
                let angle = TAU * f64::from(degrees) / 360.0;
                // y leans to x by the angle: half of it times the radius, as an oval at 45 degrees.
                let oval_um = 0.5e-3 * SQUARENESS_URAD * radius_mm * (2.0 * angle).sin();
                let [(s3, c3), (s4, c4)] = [3.0, 4.0].map(|n| (n * angle).sin_cos());
                let own_um = own[0] * c3 + own[1] * s3 + own[2] * c4 + own[3] * s4;
                let radial_um = oval_um + own_um + self.normal(READING_UM);
                writeln!(table, "{},{degrees},{radial_um:.3}", run + 1).unwrap();
            }
        }
        table
    }

    fn measured(&mut self, radius_mm: f64, feed_mm_min: f64, senses: &[f64]) -> PathBuf {
        let table = self.table(radius_mm, senses);
        let name = format!("r{radius_mm:.0}_f{feed_mm_min:.0}");
        let path = |end: &str| self.home.path().join(format!("{name}{end}"));
        std::fs::write(path(".csv"), table).unwrap();
        let map = format!(
            "start_s: 1767600000\ntest:\n  circle: {{plane: XY, centre_mm: [0.0, 0.0, 30.0], radius_mm: {radius_mm:?}, feed_mm_min: {feed_mm_min:?}, run: run, angle_deg: angle_deg, radial_um: radial_um}}\n"
        );
        std::fs::write(path(".yaml"), map).unwrap();
        let mut import = command(0, &["import"]);
        import.arg(path(".csv")).arg("--map").arg(path(".yaml"));
        import.args(["--machine", MACHINE, "-o"]).arg(path(""));
        import.current_dir(root());
        let ended = Process::start(import).ended_within(Duration::from_secs(300));
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        path("")
    }

    fn diagnosed(&self, bags: &[&Path]) -> Value {
        let json = self.home.path().join("gap.json");
        let mut diagnose = command(0, &["diagnose"]);
        diagnose.args(bags).arg("--json").arg(&json);
        diagnose.current_dir(root());
        let ended = Process::start(diagnose).ended_within(Duration::from_secs(300));
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        let begin = ended.said.find("Which:").unwrap();
        eprintln!("{}", ended.said[begin..].lines().next().unwrap());
        serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap()
    }
}

/// The only cause: its status, and it with all that could stand in its place.
fn only_cause(report: &Value) -> (&str, Vec<&str>) {
    let causes = report["causes"].as_array().unwrap();
    let [cause] = &causes[..] else {
        panic!("{causes:#?}");
    };
    let others = cause["confusable_with"].as_array().unwrap().iter();
    let open = others.filter(|other| other["excluded"] == false);
    let mut all = vec![cause["effect"].as_str().unwrap()];
    all.extend(open.map(|other| other["effect"].as_str().unwrap()));
    (cause["status"].as_str().unwrap(), all)
}

#[test]
fn what_one_sense_cannot_tell_apart_is_a_set_and_the_run_that_is_proposed_tells_it_apart() {
    let mut ballbar = Ballbar {
        home: TempDir::new().unwrap(),
        noise: Pcg64Mcg::seed_from_u64(20_261_121),
    };
    // One sense at one angular speed: a lag of an axis makes the same oval.
    let large = ballbar.measured(150.0, 1500.0, &[1.0]);
    let small = ballbar.measured(75.0, 750.0, &[1.0]);
    let report = ballbar.diagnosed(&[&large, &small]);
    let (status, set) = only_cause(&report);
    assert_eq!(status, "set");
    assert!(
        set.contains(&"squareness") && set.contains(&"servo_lag"),
        "{set:?}"
    );
    let next = &report["next_experiments"][0];
    eprintln!("next: {next}");
    assert_eq!(next["run"], "circle XY R75 F1500 both senses");
    assert!(next["delta"].as_f64().unwrap() >= 9.0, "{next}");
    let separates = next["separates"].to_string();
    assert!(
        separates.contains("squareness XY") && separates.contains("servo_lag"),
        "{next}"
    );

    let proposed = ballbar.measured(75.0, 1500.0, &[1.0, -1.0]);
    let report = ballbar.diagnosed(&[&large, &small, &proposed]);
    assert_eq!(report["inputs"]["bags"].as_array().unwrap().len(), 3);
    let (status, set) = only_cause(&report);
    assert_eq!((status, &set[..]), ("named", &["squareness"][..]));
    let value = report["causes"][0]["parameters"][0]["value"]
        .as_f64()
        .unwrap();
    assert!(
        (value.abs() - SQUARENESS_URAD).abs() < 0.1 * SQUARENESS_URAD,
        "{value}"
    );
}
