//! A cell for hours of simulated time: its memory stays flat, and its bag has every record that was published.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use abbe_tests::program::command;
use abbe_tests::scenario::Scenario;
use recorder::{Bag, Event, Order};

/// Between two looks at the process.
const LOOK: Duration = Duration::from_millis(100);
/// What is left out at the begin: models, windows and buffers fill.
const WARM_UP_H: f64 = 4.0;
/// Most that the memory may grow after it.
const LIMIT_MIB_PER_H: f64 = 1.0;
/// The same of a run that is over before the warm-up is.
const EARLY_LIMIT_MIB_PER_H: f64 = 2.0;
/// Wall time that an hour of simulated time may take, on a busy computer.
const WALL_S_PER_H: f64 = 120.0;

/// Simulated time since the start, h, and what the process holds, MiB.
type Sample = (f64, f64);

/// Runs a cell for so many simulated hours; true when memory is flat and no record is lost.
pub fn run(hours: f64) -> bool {
    let scenario = cell(hours);
    let samples = watched(&scenario, hours);
    let bag = scenario.new_run(&[]).join("bag");
    let (from_h, limit) = if hours > 2.0 * WARM_UP_H {
        (WARM_UP_H, LIMIT_MIB_PER_H)
    } else {
        (hours / 4.0, EARLY_LIMIT_MIB_PER_H)
    };
    let slope = slope_mib_per_h(&samples, from_h);
    let (records, lost) = records(&bag);
    let last = samples.last().unwrap();
    eprintln!(
        "soak: {:.1} h simulated, {} samples: {:.1} MiB at the end, {slope:+.3} MiB/h; {records} records, {lost} lost",
        last.0,
        samples.len(),
        last.1,
    );
    slope < limit && lost == 0 && records > 0
}

fn cell(hours: f64) -> Scenario {
    let scenario = Scenario::copy_of("first_run");
    let minutes = hours * 60.0;
    scenario.write(
        "plan.yaml",
        &format!(
            "title: soak\nsteps:\n  - {{do: latency, feature: block_1.z, feeds_mm_min: [60.0, 240.0, 960.0], repeats: 2}}\n  \
             - {{do: blocks, cold: true}}\n  - {{do: compensation, enable: true}}\n  \
             - {{do: produce, program: production.ngc, minutes: {minutes:.1}, serve_updates: true}}\n"
        ),
    );
    scenario.replace("scenario.yaml", "diagnose: true", "diagnose: false");
    let limit = format!("limit_min: {:.1}", minutes + 120.0);
    scenario.replace("scenario.yaml", "limit_min: 300.0", &limit);
    scenario
}

/// Runs it, looking at memory and at how far the bag is.
fn watched(scenario: &Scenario, hours: f64) -> Vec<Sample> {
    let mut run = command(0, &["run", "--no-dds"]);
    run.arg(scenario.folder())
        .arg("--runs")
        .arg(scenario.out())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let mut child = run.spawn().unwrap();
    let began = Instant::now();
    let limit = Duration::from_secs_f64(60.0 + hours * WALL_S_PER_H);
    let mut samples: Vec<Sample> = Vec::new();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if began.elapsed() > limit {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{hours} h of simulated time took longer than {limit:?}");
        }
        let at_h = simulated_h(scenario).unwrap_or(0.0);
        // What is written after the plan is not the cell's.
        if let Some(held_mib) = held_mib(child.id())
            && at_h < hours
            && samples.last().is_none_or(|(before_h, _)| at_h > *before_h)
        {
            samples.push((at_h, held_mib));
        }
        std::thread::sleep(LOOK);
    };
    assert!(status.success(), "{status}");
    samples
}

/// Memory of its own: pages of the program's file come as its code is reached, and go as the computer likes.
fn held_mib(process: u32) -> Option<f64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = text.lines().find(|line| line.starts_with("RssAnon:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

/// How much simulated time the bag holds by its own description.
fn simulated_h(scenario: &Scenario) -> Option<f64> {
    let run = std::fs::read_dir(scenario.out()).ok()?.next()?.ok()?;
    let text = std::fs::read_to_string(run.path().join("bag/metadata.yaml")).ok()?;
    let after = &text[text.find("duration:")?..];
    let line = after.lines().find(|line| line.contains("nanoseconds:"))?;
    let nanos: f64 = line.split(':').nth(1)?.trim().parse().ok()?;
    Some(nanos * 1e-9 / 3600.0)
}

/// Slope of a straight line by least squares, from some hour on.
fn slope_mib_per_h(samples: &[Sample], from_h: f64) -> f64 {
    let warm: Vec<&Sample> = samples.iter().filter(|(h, _)| *h >= from_h).collect();
    assert!(warm.len() > 5, "{} samples after {from_h} h", warm.len());
    let n = warm.len() as f64;
    let (mean_h, mean_mib) = warm
        .iter()
        .fold((0.0, 0.0), |sum, (h, mib)| (sum.0 + h / n, sum.1 + mib / n));
    let (sxy, sxx) = warm.iter().fold((0.0, 0.0), |sum, (h, mib)| {
        let from_mean_h = h - mean_h;
        (
            sum.0 + from_mean_h * (mib - mean_mib),
            sum.1 + from_mean_h * from_mean_h,
        )
    });
    sxy / sxx
}

/// Records in the bag, and those that their publishers counted and the bag lacks.
fn records(path: &Path) -> (u64, u64) {
    let bag = Bag::open(path).unwrap();
    let own = bag.metadata("abbe.recording").unwrap();
    let told = |key: &str| own[key].parse::<u64>().unwrap();
    let mut counts: BTreeMap<usize, (u64, u32)> = BTreeMap::new();
    let mut events = bag.messages(Order::File);
    while let Some(event) = events.next_event() {
        match event {
            Event::Message(message) => {
                let (count, last) = counts.entry(message.topic.index()).or_default();
                *count += 1;
                *last = message.sequence.max(*last);
            }
            Event::Loss(loss) => panic!("{loss}"),
        }
    }
    let records: u64 = counts.values().map(|(count, _)| count).sum();
    // A publisher numbers what it says from 0.
    let published: u64 = counts.values().map(|(_, last)| u64::from(*last) + 1).sum();
    assert_eq!(told("messages"), records, "{own:?}");
    (
        records,
        told("messages_lost") + published.saturating_sub(records),
    )
}
