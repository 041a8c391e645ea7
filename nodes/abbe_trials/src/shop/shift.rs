//! A trial on a shift: its bag is written as those of other arms, and diagnosed as a process or within this one.

use std::time::Instant;

use anyhow::{Context, Result};
use trials::shop::answer;
use trials::{ShiftTrial, Truth, Verdict, judge};

use super::verdict;
use crate::blind::{self, Diagnosed, Question};
use crate::seal::Seal;
use crate::session_bag;
use crate::trial::{How, Which};

/// Makes a trial; `tell` gets the seal of its truth first.
pub fn trial(how: &How, which: &Which<'_>, tell: &dyn Fn(&str)) -> Result<Vec<Verdict>> {
    let began = Instant::now();
    let ShiftTrial { rig, bare, truth } = ShiftTrial::draw(which.seed, which.index)?;
    let hides = !truth.effects.is_empty();
    let mut truth = Truth::of_a_shop(which.arm, which.seed, which.index, truth);
    truth.has_outliers = rig.scatter.outliers > 0.0;
    truth.has_motors = rig.has_motors;
    if hides {
        truth.bare_um = blind::bare_um(&bare)?;
    }
    if how.in_process {
        let recording = blind::recorded(&[&rig])?;
        let making_s = began.elapsed().as_secs_f64();
        let began = Instant::now();
        let asked = |recording| blind::in_process(&recording, &Question::default());
        let diagnosed = recording.and_then(asked);
        let times_s = [making_s, began.elapsed().as_secs_f64()];
        return Ok(vec![judged(truth, "", &diagnosed, times_s)]);
    }
    let name = format!("{}-{}-{:05}", which.arm, which.seed, which.index);
    let folder = how.out.join(&name);
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    std::fs::create_dir_all(&folder).with_context(|| format!("{}", folder.display()))?;
    let machine_text = rig.machine_text()?;
    std::fs::write(folder.join("machine.yaml"), &machine_text)?;
    session_bag::write(&rig, &folder.join("bag"), machine_text)?;
    let seal = Seal::write(&how.sealed, &name, &truth)?;
    tell(&format!("sealed {name}: sha256 {}", seal.sha256));
    let making_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let diagnosed = blind::as_process(&folder, &["bag"], &Question::default())?;
    let times_s = [making_s, began.elapsed().as_secs_f64()];
    if how.keep {
        if let Ok(answer) = &diagnosed {
            let json = serde_json::to_string_pretty(&answer.report)?;
            std::fs::write(folder.join("gap.json"), json)?;
        }
    } else {
        std::fs::remove_dir_all(&folder)?;
    }
    Ok(vec![judged(
        seal.open()?,
        &seal.sha256,
        &diagnosed,
        times_s,
    )])
}

fn judged(truth: Truth, sha256: &str, diagnosed: &Diagnosed, times_s: [f64; 2]) -> Verdict {
    let answered = diagnosed.as_ref().map_err(String::clone);
    let answered = answered.map(|own| (judge(&own.report), answer(&own.report, "")));
    verdict(truth, sha256, answered, times_s)
}
