//! The folder of a designed programme: plan, programs, machine, parameters, launch file, and the steps of a person in order.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use gap_diagnosis::design::Rung;
use metrology::number::number;
use reports::whole_file::{self, WholeFolder};

use super::instruments::{Means, Shop};
use super::menu::{Offer, SetUp};
use super::stand_in::StandIn;

/// The name of the launch file.
const LAUNCH: &str = "designed.launch.xml";
/// What a person reads first.
pub const INSTRUCTIONS: &str = "INSTRUCTIONS.md";
/// First instant of simulated time, s since the epoch.
const START_S: i64 = 1_767_600_000;
/// Longest time of the plan over the designed one.
const LIMIT: f64 = 3.0;

/// One set-up of a programme with its tests, each as often as it is repeated.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    /// The set-up.
    pub set_up: SetUp,
    /// The tests in their order: each once, then those that are repeated once more, and so on.
    pub tests: Vec<Offer>,
}

/// The set-ups of a programme in order: probe, grid, laser, ballbar; what warms comes last in its set-up.
pub fn stands(offers: &[Offer], rung: &Rung) -> Vec<Stand> {
    let mut by_set_up = BTreeMap::<(Means, String), Vec<(&Offer, usize)>>::new();
    for (title, repeats) in &rung.tests {
        if let Some(offer) = offers.iter().find(|offer| offer.title == *title) {
            let key = (offer.set_up.means, offer.set_up.name.clone());
            by_set_up.entry(key).or_default().push((offer, *repeats));
        }
    }
    let stand = |mut tests: Vec<(&Offer, usize)>| {
        tests.sort_by_key(|(offer, _)| offer.heat.is_some());
        let most = tests.iter().map(|(_, n)| *n).max().unwrap_or(0);
        let (set_up, _) = tests.first().map(|(offer, n)| (&offer.set_up, n))?;
        let of_round = |round: usize| tests.iter().filter(move |(_, n)| *n > round);
        Some(Stand {
            set_up: set_up.clone(),
            tests: (0..most)
                .flat_map(of_round)
                .map(|(offer, _)| (*offer).clone())
                .collect(),
        })
    };
    by_set_up.into_values().filter_map(stand).collect()
}

/// The plan's text.
pub fn plan(stands: &[Stand], minutes: f64) -> String {
    let mut text = format!(
        "title: designed programme of {} min\nsteps:\n",
        number(minutes)
    );
    for step in stands
        .iter()
        .flat_map(|stand| &stand.tests)
        .flat_map(|test| &test.steps)
    {
        let _ = writeln!(text, "  - {step}");
    }
    text
}

/// Everything that a folder is written of.
pub struct Contents<'c> {
    /// Text of the machine file.
    pub machine: &'c str,
    /// Text of the plan.
    pub plan: String,
    /// What a person reads first.
    pub instructions: String,
    /// Programs that the plan names, with their texts.
    pub programs: BTreeMap<String, String>,
    /// The fake machine.
    pub stand_in: &'c StandIn,
    /// Minutes that were wanted.
    pub minutes: f64,
}

/// What the instructions of a designed programme are made of.
pub struct Setting<'s> {
    /// Set-ups with their tests.
    pub stands: &'s [Stand],
    /// Times of set-ups.
    pub shop: &'s Shop,
    /// Places of thermometers, a line each; empty without.
    pub thermometers: &'s [String],
    /// Minutes that the programme takes.
    pub used_min: f64,
}

/// The programs of all tests, by name.
pub fn programs(stands: &[Stand]) -> BTreeMap<String, String> {
    let tests = stands.iter().flat_map(|stand| &stand.tests);
    let named = tests.flat_map(|test| &test.programs);
    named
        .map(|(name, text)| (name.clone(), text.clone()))
        .collect()
}

/// Writes the files into a new or empty folder, and returns their paths.
///
/// # Errors
/// When the folder holds files, or one cannot be written.
pub fn write(folder: &Path, contents: &Contents<'_>) -> Result<Vec<PathBuf>> {
    check_empty(folder)?;
    let whole = WholeFolder::begin(folder)?;
    std::fs::create_dir(whole.path()).with_context(|| folder.display().to_string())?;
    let mut files = contents.programs.clone();
    let fixed = [
        ("machine.yaml", contents.machine.to_owned()),
        ("plan.yaml", contents.plan.clone()),
        ("scenario.yaml", scenario(contents.minutes)),
        ("sequencer.yaml", SEQUENCER.to_owned()),
        ("fake_cnc.yaml", contents.stand_in.parameters.clone()),
        ("plant.yaml", contents.stand_in.plant.clone()),
        (LAUNCH, LAUNCHED.to_owned()),
        (INSTRUCTIONS, contents.instructions.clone()),
    ];
    files.extend(fixed.map(|(name, text)| (name.to_owned(), text)));
    let mut written = Vec::new();
    for (name, text) in &files {
        whole_file::write(&whole.path().join(name), text)?;
        written.push(folder.join(name));
    }
    whole.finish()?;
    Ok(written)
}

/// Refuses a folder with files in it: nothing is overwritten.
///
/// # Errors
/// Names the folder and the remedy.
pub fn check_empty(folder: &Path) -> Result<()> {
    if !folder.exists() {
        return Ok(());
    }
    let mut entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    if entries.next().is_some() {
        bail!(
            "-o {}: holds files, and nothing is overwritten: name a new or an empty folder",
            folder.display()
        );
    }
    Ok(())
}

const SEQUENCER: &str =
    "/**:\n  ros__parameters:\n    machine_file: machine.yaml\n    plan_file: plan.yaml\n";
const LAUNCHED: &str = "<launch>\n  <node pkg=\"abbe\" exec=\"fake_cnc\"><param from=\"$(dirname)/fake_cnc.yaml\"/></node>\n  \
     <node pkg=\"abbe\" exec=\"sequencer\"><param from=\"$(dirname)/sequencer.yaml\"/></node>\n</launch>\n";

fn scenario(minutes: f64) -> String {
    format!(
        "title: designed programme of {} min\nreport: gap\ndiagnose: true\nsimulated_start_s: {START_S}\nlimit_min: {:.1}\n",
        number(minutes),
        (LIMIT * minutes).max(60.0)
    )
}

/// What a person does, in order, with the steps of the plan that each set-up has.
pub fn instructions(folder: &Path, setting: &Setting<'_>) -> String {
    let shown = folder.display();
    let mut text = format!(
        "# Designed programme\n\nIt takes about {} min, set-ups included. The numbers of steps are those of `plan.yaml`.\n",
        number((10.0 * setting.used_min).round() / 10.0)
    );
    if !setting.thermometers.is_empty() {
        text.push_str(
            "\n## Before the first step\n\nRead these thermometers during the whole programme:\n\n",
        );
        for line in setting.thermometers {
            let _ = writeln!(text, "- {line}");
        }
    }
    let mut step = 0;
    for (k, stand) in setting.stands.iter().enumerate() {
        let _ = write!(
            text,
            "\n## {}. {} ({} min to set up)\n\n{}\n\n",
            k + 1,
            stand.set_up.name,
            number(setting.shop.minutes(stand.set_up.means)),
            stand.set_up.words
        );
        for test in &stand.tests {
            let first = step + 1;
            step += test.steps.len();
            let steps = if first == step {
                format!("step {first}")
            } else {
                format!("steps {first} to {step}")
            };
            let _ = writeln!(text, "- {steps}: {}", test.title);
            if test.heat == Some(super::menu::Heat::Spindle) {
                text.push_str(
                    "  (take the probe out before the spindle turns, and put it back afterwards)\n",
                );
            }
        }
    }
    let _ = write!(
        text,
        "\n## Run it\n\nOn the fake machine: `abbe run {shown}`. On a machine, start the controller's node in place of `fake_cnc` in \
         `{LAUNCH}`; plan and programs stay as they are. Then:\n\n```sh\nabbe diagnose BAG --machine {shown}/machine.yaml\n```\n"
    );
    text
}
