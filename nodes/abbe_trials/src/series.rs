//! A series of trials of one arm, several at a time.

use node_runtime::complain;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use anyhow::Result;
use gap_diagnosis::Rule;
use indicatif::{ProgressBar, ProgressStyle};
use trials::{Arm, Verdict};

use crate::journal::{Journal, NotMeasured};
use crate::shop;
use crate::trial::{How, Which};

/// What came of a trial.
enum Made {
    Judged(Vec<Verdict>),
    NotMeasured(NotMeasured),
}

/// A series.
pub struct Series<'a> {
    /// Its seed.
    pub seed: u64,
    /// Trials in it.
    pub n: u64,
    /// Rules that are switched off one at a time, beside the whole diagnosis.
    pub ablated: &'a [Rule],
    /// How many at a time; 0: as many as there are cores.
    pub jobs: usize,
    /// How.
    pub how: &'a How,
}

impl Series<'_> {
    /// Makes what is not in the journal.
    ///
    /// # Errors
    /// When a trial cannot be made or the journal not written.
    pub fn run(&self, arm: Arm, journal: &mut Journal) -> Result<()> {
        let wanted = self.wanted(arm, journal);
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let jobs = if self.jobs == 0 { cores() } else { self.jobs };
        let bar = bar(arm, wanted.len());
        let next = AtomicUsize::new(0);
        let (said, heard) = mpsc::channel();
        std::thread::scope(|scope| {
            for _ in 0..jobs.min(wanted.len()) {
                let (said, next, wanted, bar) = (said.clone(), &next, &wanted, &bar);
                scope.spawn(move || {
                    while let Some((index, rules)) =
                        wanted.get(next.fetch_add(1, Ordering::Relaxed))
                    {
                        let which = Which {
                            arm,
                            seed: self.seed,
                            index: *index,
                            rules,
                        };
                        if said.send(self.made(&which, bar)).is_err() {
                            return;
                        }
                    }
                });
            }
            drop(said);
            for made in &heard {
                match made? {
                    Made::Judged(verdicts) => {
                        for verdict in verdicts {
                            tell(&bar, &sentence(&verdict));
                            journal.add(verdict)?;
                        }
                    }
                    Made::NotMeasured(machine) => {
                        tell(&bar, &machine.to_string());
                        journal.add_not_measured(machine)?;
                    }
                }
                bar.inc(1);
            }
            drop(heard);
            Ok::<(), anyhow::Error>(())
        })?;
        bar.finish_and_clear();
        Ok(())
    }

    /// Makes a trial; a machine on which its programme does not get to its end is an outcome, too.
    fn made(&self, which: &Which<'_>, bar: &ProgressBar) -> Result<Made> {
        let made = self.how.trial(which, &|line| tell(bar, line));
        let error = match made {
            Ok(verdicts) => return Ok(Made::Judged(verdicts)),
            Err(error) => error,
        };
        let Some(machine) = NotMeasured::of(which, &error) else {
            let Which {
                arm, seed, index, ..
            } = which;
            return Err(error.context(format!("trial {arm} {index}, seed {seed}")));
        };
        self.how.tidy(which)?;
        Ok(Made::NotMeasured(machine))
    }

    /// Trials of which the journal lacks a diagnosis, with the rules that are off in those.
    fn wanted(&self, arm: Arm, journal: &Journal) -> Vec<(u64, Vec<Option<Rule>>)> {
        let all = || std::iter::once(None).chain(self.ablated.iter().copied().map(Some));
        let lacking = |index: u64| -> Vec<Option<Rule>> {
            let has = |rule: &Option<Rule>| journal.has(arm, self.seed, index, *rule);
            all().filter(|rule| !has(rule)).collect()
        };
        (0..self.n)
            .map(|index| (index, lacking(index)))
            .filter(|(_, rules)| !rules.is_empty())
            .collect()
    }
}

fn bar(arm: Arm, trials: usize) -> ProgressBar {
    let bar = ProgressBar::new(trials as u64);
    let style = ProgressStyle::with_template("{prefix}\n[{bar:40}] {pos} of {len}, {eta} left");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.set_prefix(format!("arm {arm}: {}", arm.title()));
    bar
}

/// A line above the bar; a plain line where there is no terminal.
fn tell(bar: &ProgressBar, line: &str) {
    if bar.is_hidden() {
        complain!("{line}");
    } else {
        bar.println(line);
    }
}

/// One trial in a line.
fn sentence(verdict: &Verdict) -> String {
    let truth = &verdict.truth;
    let of_a_shop = truth.shop.iter().flat_map(|shop| &shop.effects);
    let mut effects: Vec<String> = of_a_shop.map(shop::effect_words).collect();
    let of_the_plant = truth.effects.iter().map(|e| {
        format!(
            "{} {} {:.3} {} (D {:.0})",
            e.class.id(),
            e.axis,
            e.size,
            e.unit,
            e.d
        )
    });
    effects.extend(of_the_plant);
    let hidden = if effects.is_empty() {
        "nothing".to_owned()
    } else {
        effects.join(", ")
    };
    let said = match &verdict.said {
        None => format!("refused: {}", verdict.refused.as_deref().unwrap_or("")),
        Some(said) => {
            let causes: Vec<String> = said
                .causes
                .iter()
                .map(|c| {
                    let status = if c.is_named() { "" } else { "?" };
                    format!("{} {}{status}", c.effect, c.axis)
                })
                .collect();
            let unknown = if said.is_unknown { " + unknown" } else { "" };
            let floor = if said.is_reproduced {
                ""
            } else {
                " (floor not reproduced)"
            };
            let causes = if causes.is_empty() {
                "nothing".to_owned()
            } else {
                causes.join(", ")
            };
            format!("{causes}{unknown}{floor}")
        }
    };
    let (making_s, diagnosis_s) = (verdict.making_s, verdict.diagnosis_s);
    let without = verdict
        .ablated
        .map_or(String::new(), |rule| format!(" without {rule}"));
    format!(
        "{} {}{without}: {hidden} -> {said}  [{making_s:.1} + {diagnosis_s:.1} s]",
        truth.arm, truth.index
    )
}
