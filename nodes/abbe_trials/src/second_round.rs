//! The second round of a trial: what the first diagnosis asks for is measured on the same machine, and both bags are diagnosed.
//!
//! | arm | second round |
//! |---|---|
//! | vii | the first run that the report asks for |
//! | s7 | the programme that `abbe diagnose --design-next` wrote, where it wrote one |

use std::path::Path;

use anyhow::Result;
use gap_diagnosis::design::second_round;
use gap_diagnosis::report::NextExperiment;
use sequencer::extra_run;
use trials::designed::SECOND_ROUND_MIN;
use trials::{Arm, Rig, Second, judge};

use crate::blind::{Diagnosed, SECOND_ROUND};
use crate::design;
use crate::trial::Answer;

/// What is measured once more.
struct Round<'r> {
    tests: Vec<&'r NextExperiment>,
    /// The machine with its plan; none where its plan cannot do that.
    rig: Option<Rig>,
}

/// The second round of an arm that has one; `ask` diagnoses both sessions.
///
/// # Errors
/// When a programme that was written cannot be read.
pub fn second(
    arm: Arm,
    answers: &[Answer],
    (rig, folder): (&Rig, &Path),
    ask: &dyn Fn(&Rig) -> Result<Diagnosed>,
) -> Result<Option<Second>> {
    let first = answers.iter().find(|(rule, ..)| rule.is_none());
    let Some((_, Ok(answer), _)) = first else {
        return Ok(None);
    };
    let next = &answer.report.next_experiments;
    let round = match arm {
        Arm::TwoRounds => asked(rig, next),
        Arm::DesignedTwoRounds => designed(rig, next, folder)?,
        _ => None,
    };
    let Some(round) = round else {
        return Ok(None);
    };
    let diagnosed = match &round.rig {
        Some(later) => ask(later),
        None => Ok(Err("this machine's plan cannot do that run".to_owned())),
    };
    // A run that is too fast or too wide for the machine is refused by its control: that is the diagnosis' mistake.
    let diagnosed: Diagnosed = diagnosed.unwrap_or_else(|error| Err(format!("{error:#}")));
    let (said, refused) = match diagnosed {
        Ok(answer) => (Some(judge(&answer.report)), None),
        Err(reason) => (None, Some(reason)),
    };
    let tests = || round.tests.iter();
    let runs: Vec<&str> = tests().map(|test| test.run.as_str()).collect();
    Ok(Some(Second {
        run: runs.join("; "),
        separates: tests().flat_map(|test| test.separates.clone()).collect(),
        delta: tests()
            .map(|test| test.delta)
            .reduce(f64::min)
            .unwrap_or(0.0),
        said,
        refused,
    }))
}

/// The first run that is asked for.
fn asked<'r>(rig: &Rig, next: &'r [NextExperiment]) -> Option<Round<'r>> {
    let first = next.first()?;
    let plan = extra_run(&rig.machine, &rig.plan, &first.run);
    Some(Round {
        tests: vec![first],
        rig: plan.map(|plan| rig.later(plan)),
    })
}

/// The programme in a trial's folder; none where the diagnosis wrote none.
fn designed<'r>(rig: &Rig, next: &'r [NextExperiment], folder: &Path) -> Result<Option<Round<'r>>> {
    let written = folder.join(SECOND_ROUND);
    if !written.exists() {
        return Ok(None);
    }
    let programme = design::read(&written)?;
    let mut later = rig.later(programme.plan);
    later.programs.extend(programme.programs);
    let chosen = second_round(next, SECOND_ROUND_MIN).into_iter();
    Ok(Some(Round {
        tests: chosen.filter_map(|place| next.get(place)).collect(),
        rig: Some(later),
    }))
}
