//! A shift that a machine really had, as load of the fake machine.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use abbe_msgs::{Wire, from_cdr, msg, sensor_msgs};
use abbe_tests::foreseen::Foreseen;
use abbe_tests::program::{command, root};
use abbe_tests::scenario::Scenario;
use metrology::sample::Verdict;
use recorder::{Bag, Event, Order};
use serde_json::Value;

const DATA: &str = "nodes/mtconnect_bridge/tests/data";

/// What the programs add up to: turns of the spindle, travels of X, Y and Z in mm, time in s.
#[derive(Debug, Default)]
struct Load {
    turns: f64,
    travel_mm: [f64; 3],
    time_s: f64,
}

impl Load {
    fn add(&mut self, program: &str) {
        let (mut rpm, mut at_mm) = (0.0, [0.0; 3]);
        for line in program.lines().filter(|line| !line.starts_with('(')) {
            let word = |letter: char| {
                let word = line.split(' ').find(|word| word.starts_with(letter));
                word.map(|word| word[1..].parse::<f64>().unwrap())
            };
            rpm = word('S').unwrap_or(if line == "M5" { 0.0 } else { rpm });
            let mut step_mm = [0.0; 3];
            for ((letter, at_mm), step_mm) in "XYZ".chars().zip(&mut at_mm).zip(&mut step_mm) {
                let next_mm = word(letter).unwrap_or(*at_mm);
                *step_mm = next_mm - std::mem::replace(at_mm, next_mm);
            }
            let length_mm = step_mm
                .iter()
                .map(|step_mm| step_mm * step_mm)
                .sum::<f64>()
                .sqrt();
            let lasts_s = match line.split(' ').next() {
                Some("G1") => 60.0 * length_mm / word('F').unwrap(),
                Some("G4") => word('P').unwrap(),
                _ => continue,
            };
            self.time_s += lasts_s;
            self.turns += rpm / 60.0 * lasts_s;
            for (travel_mm, step_mm) in self.travel_mm.iter_mut().zip(step_mm) {
                *travel_mm += step_mm.abs();
            }
        }
    }
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

/// The programs in the tree are those of the log, and add up to what a few lines of Python, which hold each speed until
/// the next and sum the differences of positions, found in the log itself from 11:15 to 15:15.
#[test]
fn val_nist_the_programs_of_the_shift_have_its_turns_and_travels() {
    let home = tempfile::tempdir().unwrap();
    let packed = root().join(DATA).join("mazak01_20161129.shdr.gz");
    let day = Command::new("gzip")
        .arg("-dc")
        .arg(packed)
        .output()
        .unwrap();
    let log = home.path().join("day.shdr");
    std::fs::write(&log, day.stdout).unwrap();
    let folder = root().join("launch_configs/real_shift");
    let ended = command(0, &["import-shift", "--map"])
        .arg(root().join(DATA).join("mazak01_map.yaml"))
        .arg("--order")
        .arg(folder.join("order.yaml"))
        .arg("--machine")
        .arg(folder.join("machine.yaml"))
        .arg("-o")
        .arg(home.path())
        .arg(&log)
        .output()
        .unwrap();
    // The controller was off for a minute five times: no speed and no position.
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(3), "{said}");
    let mut load = Load::default();
    for n in 0..16 {
        let name = format!("shift_{n:02}.ngc");
        let program = read(&home.path().join(&name));
        assert_eq!(program, read(&folder.join(&name)), "{name}");
        load.add(&program);
    }
    eprintln!("{load:?}");
    let wanted = [479_878.788, 80_172.428, 6_070.946, 29_979.237, 14_400.0];
    let [x_mm, y_mm, z_mm] = load.travel_mm;
    for (value, wanted) in [load.turns, x_mm, y_mm, z_mm, load.time_s]
        .into_iter()
        .zip(wanted)
    {
        assert!((value / wanted - 1.0).abs() < 5e-5, "{value}: {wanted}");
    }
}

/// How `import-shift` of a log with a mapping ends, what it says, and how many programs it writes.
fn imported(log: &str, map: &str) -> (Option<i32>, String, usize) {
    let home = tempfile::tempdir().unwrap();
    let place = |name: &str| home.path().join(name);
    std::fs::write(place("log.shdr"), log).unwrap();
    std::fs::write(place("map.yaml"), map).unwrap();
    let folder = root().join("launch_configs/real_shift");
    let ended = command(0, &["import-shift", "--map"])
        .arg(place("map.yaml"))
        .arg("--order")
        .arg(folder.join("order.yaml"))
        .arg("--machine")
        .arg(folder.join("machine.yaml"))
        .arg("-o")
        .arg(place("out"))
        .arg(place("log.shdr"))
        .output()
        .unwrap();
    let programs = std::fs::read_dir(place("out")).map_or(0, Iterator::count);
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    (ended.status.code(), said, programs)
}

/// The order is of 2016-11-29 from 11:15 to 15:15: four hours are 16 programs of 900 s.
#[test]
fn a_log_that_lacks_the_shift_or_a_part_of_it_is_no_standing_machine() {
    let map = read(&root().join(DATA).join("mazak01_map.yaml"));
    let whole = "2016-11-29T11:00:00Z|Srpm|600\n2016-11-29T13:00:00Z|Srpm|1200\n2016-11-29T16:00:00Z|Srpm|0\n";
    let (code, said, programs) = imported(whole, &map);
    assert_eq!((code, programs), (Some(3), 16), "{said}");
    assert!(
        said.contains("warning: no line from 2016-11-29T11:15:00Z to 2016-11-29T13:00:00Z"),
        "{said}"
    );
    let none = [
        (String::new(), "no line with a value has a date"),
        ("hello\n".to_owned(), "1 lines without a bar"),
        (
            whole.replace("2016", "2026"),
            "it reaches from 2026-11-29T11:00:00Z to 2026-11-29T16:00:00Z: correct from and to in the order",
        ),
    ];
    for (log, words) in none {
        let (code, said, programs) = imported(&log, &map);
        assert_eq!((code, programs), (Some(1), 0), "{said}");
        assert!(said.contains(words), "{said}");
    }
    let half = "of 2016-11-29T11:15:00Z to 2016-11-29T15:15:00Z, the log covers 2016-11-29T11:15:00Z to 2016-11-29T13:00:00Z";
    let leap = "the machine's clock leaps from 2016-11-29T13:00:00Z to 2016-12-01T16:00:00Z";
    for (log, words) in [
        (whole.replace("2016-11-29T16:00:00Z|Srpm|0\n", ""), half),
        (
            whole.replace("29T16", "31T16").replace("11-31", "12-01"),
            leap,
        ),
    ] {
        let (code, said, programs) = imported(&log, &map);
        assert_eq!((code, programs), (Some(3), 16), "{said}");
        assert!(said.contains(words), "{said}");
    }
    let (code, said, programs) = imported(whole, "values: {}\n");
    assert_eq!((code, programs), (Some(1), 0));
    assert!(
        said.contains("map.yaml: the mapping has no spindle speed \"spindle_speed\"")
            && !said.contains("log.shdr"),
        "{said}"
    );
}

/// Of the log that stands beside: `awk -F'|' '$2=="Stemp" && $3+0>0' shift.shdr | wc -l` and the same with `$3=="0"`.
#[test]
fn scenario_a_real_shift_is_compensated_and_its_log_stands_beside_it() {
    let began = Instant::now();
    let scenario = Scenario::copy_of("real_shift");
    let foreseen = Foreseen::begin(&scenario.folder());
    let run = scenario.run();
    foreseen.agrees(&scenario.folder(), &run);
    let report: Value = serde_json::from_str(&read(&run.join("report.json"))).unwrap();
    let span = &report["tool_error_in_blocks_span"];
    let p95_mm = |which: &str| span[which]["change_since_cold_p95_mm"].as_f64().unwrap();
    let (without_mm, with_mm) = (p95_mm("without_compensation"), p95_mm("with_compensation"));
    let (good, verdicts) = log_temperatures(&run.join("bag"));
    eprintln!(
        "real_shift: {:.1} s; p95 {:.2} um without, {:.2} um with; temperatures {good}, {verdicts:?}",
        began.elapsed().as_secs_f64(),
        without_mm * 1e3,
        with_mm * 1e3
    );
    assert!(
        without_mm > 8e-3,
        "{without_mm} mm: the shift warms the machine"
    );
    assert!(without_mm / with_mm >= 4.0, "{without_mm} mm, {with_mm} mm");
    assert_eq!((good, verdicts), (641, [641, 200, 0]));
}

/// Temperatures of the log in the bag, and verdicts: good, impossible, unconfirmed.
fn log_temperatures(bag: &Path) -> (usize, [usize; 3]) {
    let bag = Bag::open(bag).unwrap();
    let mut messages = bag.messages(Order::LogTime);
    let (mut good, mut verdicts) = (0, [0; 3]);
    while let Some(event) = messages.next_event() {
        let Event::Message(message) = event else {
            panic!("the bag has a loss");
        };
        match bag.topic(message.topic).topic.as_str() {
            "/temperature/log_spindle" => {
                let sample: sensor_msgs::msg::Temperature = from_cdr(message.data).unwrap();
                assert!(sample.temperature > 40.0, "{sample:?}");
                good += 1;
            }
            "/machine/log_spindle" => {
                let value: msg::MachineValue = from_cdr(message.data).unwrap();
                let value = value.into_inner().unwrap();
                let place = match value.verdict {
                    Verdict::Good => 0,
                    Verdict::Impossible => 1,
                    Verdict::Unconfirmed => 2,
                };
                verdicts[place] += 1;
            }
            _ => {}
        }
    }
    (good, verdicts)
}
