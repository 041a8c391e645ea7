//! What a plan may hold for a preflight: its measurements are simulated once for every effect of the catalogue.
//!
//! A run in motion takes a tenth of a second and 4 MB, an hour of standing two seconds; touches of one cycle are compared
//! with each other, 2000 of them in four seconds, 8000 in two minutes. Within these bounds a preflight answers in about a
//! minute.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};
use machine::MachineFile;
use metrology::bound::Bound;
use metrology::number::number;
use sequencer::{Load, Plan};

use super::dry_run::LIMIT_S;

const REMEDY: &str = "; ask it of the same steps with fewer repeats, or of a part of the plan";
const RUNS: Bound = Bound::at_most(500).with_remedy(REMEDY);
const STOPS: Bound = Bound::at_most(50_000).with_remedy(REMEDY);
const TOUCHES: Bound = Bound::at_most(4_000).with_remedy(REMEDY);

/// Refuses a plan too large for a preflight, before anything is made of it.
///
/// # Errors
/// With what the plan holds, how much of it, the limit and the remedy; as the plan itself would be refused.
pub fn check(
    plan: &Plan,
    programs: &BTreeMap<String, String>,
    machine: &MachineFile,
) -> Result<()> {
    within(&sequencer::load(plan, machine, programs).context("plan")?)
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
                "{do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 1500.0, stations: 50001, dwell_s: 0.1}".to_owned(),
                "50001 stops of measuring steps: at most 50000; ask",
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
