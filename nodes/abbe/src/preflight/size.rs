//! What a plan may hold for a preflight: its measurements are simulated once for every effect of the catalogue.
//!
//! A run in motion takes a tenth of a second and 4 MB, 3600 stops four seconds, an hour of standing two seconds; touches of one
//! cycle are compared with each other, 2000 of them in four seconds, 8000 in two minutes. Within these bounds a preflight answers
//! in about a minute.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};
use machine::MachineFile;
use metrology::bound::Bound;
use metrology::number::number;
use node_runtime::complain;
use sequencer::{Load, Plan};

use super::dry_run::LIMIT_S;

const REMEDY: &str = "; ask it of the same steps with fewer repeats, or of a part of the plan";
const RUNS: Bound = Bound::at_most(500).with_remedy(REMEDY);
const STOPS: Bound = Bound::at_most(5_000).with_remedy(REMEDY);
const TOUCHES: Bound = Bound::at_most(4_000).with_remedy(REMEDY);

/// Time of a run in motion, of a stop, and of two touches that are compared, s.
const RUN_S: f64 = 0.1;
const STOP_S: f64 = 0.0015;
const TOUCHES_S: f64 = 1e-6;
/// A preflight that takes longer is announced, s.
const SAID_FROM_S: f64 = 15.0;

/// Refuses a plan too large for a preflight, before anything is made of it.
///
/// # Errors
/// With what the plan holds, how much of it, the limit and the remedy; as the plan itself would be refused.
pub fn check(
    plan: &Plan,
    programs: &BTreeMap<String, String>,
    machine: &MachineFile,
) -> Result<()> {
    let load = sequencer::load(plan, machine, programs).context("plan")?;
    within(&load)?;
    let expected_s = expected_s(&load);
    if expected_s > SAID_FROM_S {
        complain!(
            "abbe: {} runs, {} stops and {} touches are simulated for every effect: about {expected_s:.0} s",
            load.runs,
            load.stops,
            load.touches
        );
    }
    Ok(())
}

/// How long a preflight of a plan takes, s; by the times above.
fn expected_s(load: &Load) -> f64 {
    let touches = load.touches as f64;
    RUN_S * load.runs as f64 + STOP_S * load.stops as f64 + TOUCHES_S * touches * touches
}

/// Refuses more touches than a preflight compares, those of cycles that nodes ask for counted.
///
/// # Errors
/// With their number, the limit and the remedy.
pub fn check_touches(touches: u64) -> Result<()> {
    TOUCHES.check_amount(|| "run of a preflight".to_owned(), "touches", touches)?;
    Ok(())
}

fn within(load: &Load) -> Result<()> {
    let place = || "plan for a preflight".to_owned();
    RUNS.check_amount(place, "runs of measuring steps", load.runs)?;
    STOPS.check_amount(place, "stops of measuring steps", load.stops)?;
    TOUCHES.check_amount(place, "touches", load.touches)?;
    let (least_h, limit_h) = (load.least_min / 60.0, LIMIT_S / 3600.0);
    if least_h.is_nan() || least_h > limit_h {
        bail!(
            "plan for a preflight: its rest, production and way take at least {} h: at most {} h{REMEDY}",
            number(least_h),
            number(limit_h)
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../../launch_configs/grid_xy/machine.yaml");

    fn of(step: &str) -> Result<()> {
        let machine = MachineFile::parse(MACHINE, "machine.yaml")?;
        let plan = Plan::from_yaml(&format!("title: t\nsteps:\n  - {step}\n"))?;
        check(&plan, &BTreeMap::new(), &machine)
    }

    #[test]
    fn a_plan_at_its_own_limits_is_refused_with_what_value_limit_and_remedy() {
        let circle = |repeats: u32| {
            format!(
                "{{do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 1500.0, sense: both, on_the_fly: true, repeats: {repeats}}}"
            )
        };
        for (step, words) in [
            (
                circle(10_000),
                "20000 runs of measuring steps: at most 500; ask it of",
            ),
            (
                "{do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 1500.0, stations: 5001, dwell_s: 0.1}".to_owned(),
                "5001 stops of measuring steps: at most 5000; ask",
            ),
            (
                "{do: wait, seconds: 90000.0}".to_owned(),
                "at least 25 h: at most 24 h; ask",
            ),
        ] {
            let said = format!("{:#}", of(&step).expect_err("too large"));
            assert!(said.contains(words), "{words}: {said}");
        }
        assert!(of(&circle(250)).is_ok());
    }

    #[test]
    fn a_plan_at_every_limit_takes_two_minutes_at_most_and_shipped_ones_seconds() {
        let load = |runs, stops, touches| Load {
            runs,
            stops,
            touches,
            ..Load::default()
        };
        for (load, within_s) in [
            (load(500, 0, 0), 60.0),
            (load(0, 5_000, 0), 70.0),
            (load(0, 0, 4_000), 20.0),
            (load(500, 5_000, 4_000), 130.0),
            (load(27, 200, 50), SAID_FROM_S),
        ] {
            assert!(within(&load).is_ok());
            assert!(expected_s(&load) < within_s, "{}", expected_s(&load));
        }
    }

    #[test]
    fn touches_are_bounded_where_their_comparison_takes_a_minute() {
        let load = |touches| Load {
            touches,
            ..Load::default()
        };
        assert!(within(&load(4_000)).is_ok());
        let said = format!("{:#}", within(&load(4_001)).expect_err("too many"));
        assert!(said.contains("4001 touches: at most 4000; ask"), "{said}");
    }
}
