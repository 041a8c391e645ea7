//! `abbe diagnose BAG... --design-next`: the best small programme for what is still open, as a scenario's folder.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use gap_diagnosis::design::second_round;
use gap_diagnosis::report::{GapReport, NextExperiment};
use machine::MachineFile;
use metrology::number::number;
use node_runtime::text_file;
use sequencer::{Plan, extra_run};

use crate::preflight::design::folder::{self, Contents, INSTRUCTIONS};
use crate::preflight::design::{control, stand_in};
use crate::usage::refused;
use crate::validate;

/// Range of the minutes of a second round.
const MINUTES: [f64; 2] = [1.0, 480.0];

/// What a second round is made of.
pub struct Round<'r> {
    /// The bags.
    pub bags: &'r [PathBuf],
    /// The plan that was run: touches and the session's own tests are repeated from it.
    pub plan: Option<&'r Path>,
    /// Name and text of the machine file.
    pub machine: (&'r str, &'r str),
    /// Minutes that there are, set-ups included.
    pub minutes: f64,
    /// Where the folder is written.
    pub out: &'r Path,
}

impl Round<'_> {
    /// Refuses minutes and a folder that cannot be used, before anything is computed.
    ///
    /// # Errors
    /// With value and limit.
    pub fn check(&self) -> Result<()> {
        if !(MINUTES[0]..=MINUTES[1]).contains(&self.minutes) {
            let reason = format!(
                "--minutes {}: must be from {} to {} min",
                number(self.minutes),
                number(MINUTES[0]),
                number(MINUTES[1])
            );
            return Err(refused("diagnose", reason));
        }
        folder::check_empty(self.out)
    }

    /// Writes the folder, where a test decides something; what was done, a line each.
    ///
    /// # Errors
    /// When the folder cannot be written, or what is written is no scenario.
    pub fn write(&self, report: &GapReport) -> Result<Vec<String>> {
        let (name, text) = self.machine;
        let machine = MachineFile::parse(text, name)?;
        let next = &report.next_experiments;
        let done = self.done()?;
        let mut lines = Vec::new();
        let mut tests = Vec::<(&NextExperiment, Plan)>::new();
        for place in second_round(next, self.minutes) {
            let plan = extra_run(&machine, &done, &next[place].run);
            match plan.filter(|plan| !plan.steps.is_empty()) {
                Some(plan) => tests.push((&next[place], plan)),
                None => lines.push(format!(
                    "second round: \"{}\" has no steps of a plan: run it by hand, or name the plan that was run with --plan",
                    next[place].run
                )),
            }
        }
        lines.extend(self.plan_without_effect(&machine, &done, next));
        if tests.is_empty() {
            lines.push(format!(
                "second round: no test of up to {} min decides what is left open: no folder is written",
                number(self.minutes)
            ));
            return Ok(lines);
        }
        let plan = Plan {
            title: format!("second round of {} min", number(self.minutes)),
            steps: tests
                .iter()
                .flat_map(|(_, plan)| plan.steps.clone())
                .collect(),
        };
        self.write_folder(&machine, &plan, &tests)?;
        lines.push(format!(
            "{}: second round of {} tests, {} min (begin with {INSTRUCTIONS})",
            self.out.display(),
            tests.len(),
            number(
                tests
                    .iter()
                    .map(|(next, _)| next.minutes)
                    .sum::<f64>()
                    .round()
            )
        ));
        Ok(lines)
    }

    /// The line of a plan of which no test of this round repeats a step.
    fn plan_without_effect(
        &self,
        machine: &MachineFile,
        done: &Plan,
        next: &[NextExperiment],
    ) -> Option<String> {
        let path = self.plan?;
        let is_used = second_round(next, self.minutes)
            .into_iter()
            .any(|place| repeats(machine, done, &next[place].run));
        (!is_used).then(|| {
            format!(
                "second round: --plan {}: has no effect, no test of this round repeats a step of it: name the plan that was run, or leave it out",
                path.display()
            )
        })
    }

    fn write_folder(
        &self,
        machine: &MachineFile,
        plan: &Plan,
        tests: &[(&NextExperiment, Plan)],
    ) -> Result<()> {
        let plan_text = serde_saphyr::to_string(plan).context("plan")?;
        if Plan::from_yaml(&plan_text).context("plan of the second round")? != *plan {
            bail!(
                "plan of the second round: cannot be written as text: run the proposed tests by hand"
            );
        }
        let (name, text) = self.machine;
        let stand_in = stand_in::of(Path::new(name), machine, &control(machine))?;
        let contents = Contents {
            machine: text,
            plan: plan_text,
            instructions: self.instructions(tests),
            programs: BTreeMap::new(),
            stand_in: &stand_in,
            minutes: self.minutes,
        };
        let _ = folder::write(self.out, &contents)?;
        let mistakes = validate::mistakes(self.out)?;
        if mistakes.is_empty() {
            return Ok(());
        }
        bail!("{}: {}", self.out.display(), mistakes.join("; "))
    }

    fn instructions(&self, tests: &[(&NextExperiment, Plan)]) -> String {
        let mut text = "# Second round\n\nThe numbers of steps are those of `plan.yaml`. Put up what a test names before its first step.\n\n".to_owned();
        let mut step = 0;
        for (next, plan) in tests {
            let first = step + 1;
            step += plan.steps.len();
            let _ = writeln!(
                text,
                "- steps {first} to {step}: {} ({} min with its set-up): separates {}",
                next.run,
                number(next.minutes.round()),
                next.separates.join(", ")
            );
        }
        let bags: Vec<String> = self
            .bags
            .iter()
            .map(|bag| bag.display().to_string())
            .collect();
        let _ = write!(
            text,
            "\n```sh\nabbe run {}\nabbe diagnose {} BAG --machine {}/machine.yaml\n```\n",
            self.out.display(),
            bags.join(" "),
            self.out.display()
        );
        text
    }

    /// The plan that was run; without steps where it is not given, as a bag does not hold it.
    fn done(&self) -> Result<Plan> {
        let Some(path) = self.plan else {
            return Ok(not_given());
        };
        let text = text_file::yaml(path).context("plan")?;
        Plan::from_yaml(&text).with_context(|| format!("plan {}", path.display()))
    }
}

/// The plan of a round without `--plan`.
fn not_given() -> Plan {
    Plan {
        title: "not given".to_owned(),
        steps: vec![],
    }
}

/// Whether a proposed test has steps of the plan that was run, which it would not have without that.
fn repeats(machine: &MachineFile, done: &Plan, run: &str) -> bool {
    let steps = |done: &Plan| extra_run(machine, done, run).map_or(vec![], |plan| plan.steps);
    steps(done) != steps(&not_given())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOLDER: &str = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../launch_configs/gap_first"
    );

    #[test]
    fn a_plan_is_used_by_tests_that_repeat_its_steps_alone() {
        let read = |name: &str| text_file::yaml(&Path::new(FOLDER).join(name)).unwrap();
        let machine = MachineFile::parse(&read("machine.yaml"), "m").unwrap();
        let done = Plan::from_yaml(&read("plan.yaml")).unwrap();
        let reversed = "the session's own tests in reverse order";
        assert!(repeats(&machine, &done, reversed));
        assert!(!repeats(&machine, &not_given(), reversed));
        for run in ["circle XY R100 F500, F1000", "line X F500", "nothing known"] {
            assert!(!repeats(&machine, &done, run), "{run}");
        }
    }

    #[test]
    fn a_plan_that_no_test_repeats_gets_a_line_with_its_path() {
        let read = |name: &str| text_file::yaml(&Path::new(FOLDER).join(name)).unwrap();
        let text = read("machine.yaml");
        let machine = MachineFile::parse(&text, "m").unwrap();
        for plan in [
            None,
            Some(Path::new("a/plan.yaml")),
            Some(Path::new("b.yaml")),
        ] {
            let round = Round {
                bags: &[],
                plan,
                machine: ("m", &text),
                minutes: 15.0,
                out: Path::new("out"),
            };
            let said = round.plan_without_effect(&machine, &not_given(), &[]);
            assert_eq!(said.is_some(), plan.is_some());
            if let Some((said, plan)) = said.zip(plan) {
                assert!(said.contains(&format!("--plan {}: has no effect", plan.display())));
            }
        }
    }
}
