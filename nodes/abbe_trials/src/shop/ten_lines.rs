//! Ten lines for a user: what can be trusted, what cannot, from what size, with which recording.

use trials::Arm;
use trials::proportion::Proportion;
use trials::shop::{ShopTally, Split};

use crate::table::{NOT_TRIED, percent};

/// Ten sentences with the figures of the arms; what was not tried says so.
pub fn ten_lines(arms: &[ShopTally]) -> Vec<String> {
    let of = |arm: Arm| arms.iter().find(|tally| tally.arm == arm);
    let [laser, ballbar, logs] = [Arm::ShopPositioning, Arm::ShopBallbar, Arm::ShopLogs].map(of);
    let nothing = "nothing hidden: a cause named";
    let wrong = "a wrong name";
    let shift = of(Arm::ShopShift).map(of_a_shift);
    let lines = vec![
        format!(
            "A name was wrong, or alone where only a set was right, in {} of laser runs, {} of ballbars, {} of logs.",
            share(laser, wrong),
            share(ballbar, wrong),
            share(logs, wrong)
        ),
        format!(
            "A good machine was given a cause in {} of laser runs, {} of ballbars, {} of logs.",
            share(laser, nothing),
            share(ballbar, nothing),
            share(logs, nothing)
        ),
        format!(
            "Lost motion by a laser run: {}. It is always a set: one feed tells no more.",
            kinds(laser, "lost motion")
        ),
        format!("Lead error by a laser run: {}.", kinds(laser, "lead error")),
        format!(
            "Scale by a laser run: {}. A set with the wavelength: no single laser tells them apart.",
            kinds(laser, "scale")
        ),
        format!(
            "Drift during a laser run: {}. Cyclic error: {}.",
            kinds(laser, "drift"),
            kinds(laser, "cyclic error")
        ),
        format!(
            "Runs: one cycle finds {}, three or more {} of what has D above 20.",
            by(laser, "repeats", &["1"]),
            by(laser, "repeats", &["3", "4", "5"])
        ),
        format!(
            "By a ballbar: squareness {}; lost motion {}; reversal spike {}; servo mismatch {}.",
            kinds(ballbar, "squareness"),
            kinds(ballbar, "lost motion"),
            kinds(ballbar, "reversal spike"),
            kinds(ballbar, "servo mismatch")
        ),
        format!(
            "By logs: spindle {}; column {}; air {}.",
            kinds(logs, "spindle"),
            kinds(logs, "column"),
            kinds(logs, "air")
        ),
        format!(
            "By logs above D 20: lag within 25 % in {}, growth within 10 % in {}; a cause is named in {} where readings \
             scatter on their own, in {} where neighbours share half of their noise.",
            share(logs, "D above 20: lag within 25 %"),
            share(logs, "D above 20: growth within 10 %"),
            by(logs, MEMORY, &["none"]),
            by(logs, MEMORY, &["0.5 and more"])
        ),
    ];
    lines.into_iter().chain(shift).collect()
}

/// One more line, where shifts were tried.
fn of_a_shift(tally: &ShopTally) -> String {
    let own = |what: &str| share(Some(tally), what);
    format!(
        "By a shift of four hours: a wrong name in {}; above D 20 what it tells is named in {}, a change has its instant in {}.",
        own("a wrong name"),
        own("D above 20, resolvable: named"),
        own("D above 20: a change with its instant, within a test cycle")
    )
}

/// Title of the split by noise.
const MEMORY: &str = "noise that neighbouring readings share";

fn share(tally: Option<&ShopTally>, what: &str) -> String {
    let line = tally.and_then(|tally| tally.line(what));
    percent(line.map_or_else(Proportion::default, |line| line.count))
}

fn sum<'s>(all: impl Iterator<Item = &'s Split>) -> Proportion {
    let above = all.map(|split| split.found[2]);
    above.fold(Proportion::default(), |sum, own| Proportion {
        k: sum.k + own.k,
        n: sum.n + own.n,
    })
}

/// How often a kind is found above D 20, and the size that this is.
fn kinds(tally: Option<&ShopTally>, kind: &str) -> String {
    let Some(tally) = tally else {
        return NOT_TRIED.to_owned();
    };
    let own = || {
        tally
            .kinds
            .iter()
            .filter(|split| split.what.starts_with(kind))
    };
    let largest = own().max_by_key(|split| split.found[2].n);
    let size = largest.and_then(|split| split.size_of_d_20.as_ref());
    match (sum(own()), size) {
        (count, Some((size, unit))) if count.n > 0 => {
            format!(
                "found in {} above D 20, about {size:.2} {unit}",
                percent(count)
            )
        }
        _ => NOT_TRIED.to_owned(),
    }
}

fn by(tally: Option<&ShopTally>, wanted_title: &str, wanted: &[&str]) -> String {
    let splits = tally.iter().flat_map(|tally| &tally.splits);
    let own = splits
        .filter(|(title, _)| title == wanted_title)
        .flat_map(|(_, splits)| splits);
    percent(sum(
        own.filter(|split| wanted.contains(&split.what.as_str()))
    ))
}
