//! `abbe preflight --design`: the programme that names most in the minutes that there are, as a scenario's folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use gap_diagnosis::GapConfig;
use gap_diagnosis::design::{Candidate, Design, MINUTES, Order, ballbar, design};
use gap_diagnosis::preflight::Floors;
use machine::MachineFile;
use metrology::number::number;
use node_runtime::text_file;
use reports::Report;
use reports::gap::designed;
use reports::terminal::Room;
use reports::whole_file;
use sequencer::Plan;
use twin::Instrument;

pub mod folder;
mod instruments;
mod likely;
pub(super) mod menu;
mod programs;
pub mod stand_in;
pub(super) mod temperatures;

pub use super::programme::control;
pub use instruments::{Means, Mounting, means, mounting};

use folder::{Contents, INSTRUCTIONS, Setting};
use instruments::Shop;
use menu::Offer;

use super::{dry_run, foreseen_now, programme};
use crate::tell::tell;
use crate::usage::refused;
use crate::validate;

/// Rest between two tests, min.
const SETTLE_MIN: f64 = 0.1;

/// What is wanted, from the command line.
pub struct Wanted<'w> {
    /// Machine file.
    pub machine: &'w Path,
    /// Minutes that there are.
    pub minutes: f64,
    /// Instruments at hand.
    pub with: &'w [Means],
    /// Times of set-ups.
    pub mounting: &'w [Mounting],
    /// File of likely effects.
    pub likely: Option<&'w Path>,
    /// Noise of the instruments on a machine.
    pub floors: &'w dyn Fn(&MachineFile) -> Floors,
    /// Instruments whose noise is stated.
    pub floored: &'w [Instrument],
    /// Where the folder is written.
    pub out: &'w Path,
    /// Where the page is written.
    pub html: Option<&'w Path>,
    /// Figures instead of text.
    pub json: bool,
    /// Every table.
    pub full: bool,
}

/// A design with what it was made of.
struct Designed {
    offers: Vec<Offer>,
    design: Design,
    notes: Vec<String>,
    control: fake_cnc::Config,
}

impl Wanted<'_> {
    /// Designs, writes the folder, prints what it will show.
    ///
    /// # Errors
    /// For instruments, effects, minutes or files that cannot be used, and a folder that holds files.
    pub fn execute(&self) -> Result<ExitCode> {
        if !(MINUTES[0]..=MINUTES[1]).contains(&self.minutes) {
            let reason = format!(
                "--minutes {}: must be from {} to {} min",
                number(self.minutes),
                number(MINUTES[0]),
                number(MINUTES[1])
            );
            return Err(refused("preflight", reason));
        }
        folder::check_empty(self.out)?;
        let text = text_file::yaml(self.machine).context("machine file")?;
        let machine = MachineFile::parse(&text, &self.machine.display().to_string())?;
        let shop = Shop::new(self.with, self.mounting, &machine)
            .map_err(|reason| refused("preflight", reason))?;
        let designed = self.designed(&machine, &shop)?;
        let page = self.written(&text, &machine, &shop, &designed)?;
        self.tell(&page)?;
        Ok(ExitCode::SUCCESS)
    }

    fn designed(&self, machine: &MachineFile, shop: &Shop) -> Result<Designed> {
        let likely = self
            .likely
            .map(likely::read)
            .transpose()?
            .unwrap_or_default();
        let equipped = shop.equipped(machine);
        let control = programme::control(&equipped);
        let (offers, more) = menu::offers(&equipped);
        let mut notes = Vec::new();
        if more > 0 {
            notes.push(format!("{more} further tests were not looked at."));
        }
        let (offers, candidates) = candidates(offers, &equipped, shop, &control, &mut notes);
        if candidates.is_empty() {
            bail!(
                "machine file {}: no test of it can be run: {}",
                self.machine.display(),
                notes.join(" ")
            );
        }
        let offered: Vec<Means> = offers.iter().map(|offer| offer.set_up.means).collect();
        notes.extend(shop.beside(self.mounting, self.floored, &offered));
        let set_up_min: BTreeMap<String, f64> = offers
            .iter()
            .map(|offer| (offer.set_up.name.clone(), shop.minutes(offer.set_up.means)))
            .collect();
        let floors = shop.read((self.floors)(machine));
        let order = Order {
            machine: &equipped,
            floors: &floors,
            set_up_min: &set_up_min,
            minutes: self.minutes,
            likely: &likely,
            config: &GapConfig::default(),
        };
        let design = design(&candidates, &order)?;
        Ok(Designed {
            offers,
            design,
            notes,
            control,
        })
    }

    /// Writes the folder, which has to pass `abbe validate`, and the page.
    fn written(
        &self,
        text: &str,
        machine: &MachineFile,
        shop: &Shop,
        designed: &Designed,
    ) -> Result<Report> {
        let rungs = &designed.design.rungs;
        let rung = rungs.get(designed.design.wanted).context("a programme")?;
        if rung.tests.is_empty() {
            bail!(
                "--minutes {}: no test fits, since a noise floor wants one of three repeats and every set-up takes its time: give more \
                 minutes, or the time of a set-up with --mounting",
                number(self.minutes)
            );
        }
        let stands = folder::stands(&designed.offers, rung);
        let stand_in = stand_in::of(self.machine, machine, &designed.control)?;
        let sensors = machine.temperature_sensors.iter();
        let thermometers: Vec<String> = sensors
            .filter(|_| shop.has(Means::Thermometers))
            .map(|sensor| format!("`{}`, every {} s", sensor.id, number(sensor.period_s)))
            .collect();
        let setting = Setting {
            stands: &stands,
            shop,
            thermometers: &thermometers,
            used_min: rung.used_min,
        };
        let contents = Contents {
            machine: text,
            plan: folder::plan(&stands, self.minutes),
            instructions: folder::instructions(self.out, &setting),
            programs: folder::programs(&stands),
            stand_in: &stand_in,
            minutes: self.minutes,
        };
        let _ = folder::write(self.out, &contents)?;
        let mistakes = validate::mistakes(self.out)?;
        if !mistakes.is_empty() {
            bail!("{}: {}", self.out.display(), mistakes.join("; "));
        }
        let mut notes = designed.notes.clone();
        if !stand_in.is_own {
            notes.push("plant.yaml is a stand-in of usual size: no files of a fake machine are beside the machine file.".to_owned());
        }
        notes.push(format!(
            "Written: {} (begin with {INSTRUCTIONS}).",
            self.out.display()
        ));
        let title = format!(
            "Designed programme for {}: {} min",
            machine.name,
            number(self.minutes)
        );
        let mut page = designed::page(&title, &designed.design, order_of(&stands), &notes)?;
        let folder = self.out.display().to_string();
        page.screen.made = Some(foreseen_now(&machine.name, &folder));
        if let Some(path) = self.html {
            whole_file::write(path, &page.html())?;
        }
        Ok(page)
    }

    fn tell(&self, page: &Report) -> Result<()> {
        if self.json {
            tell!("{}", serde_json::to_string_pretty(&page.figures)?);
        } else if self.full {
            tell!("{}", page.terminal());
        } else {
            tell!("{}", page.short(&Room::with_page(self.html)));
        }
        Ok(())
    }
}

/// Set-up, test and repeats, a row each.
fn order_of(stands: &[folder::Stand]) -> Vec<Vec<String>> {
    let mut rows = Vec::<Vec<String>>::new();
    for stand in stands {
        let mut seen = Vec::<&str>::new();
        for test in &stand.tests {
            if seen.contains(&test.title.as_str()) {
                continue;
            }
            seen.push(&test.title);
            let repeats = stand.tests.iter().filter(|other| other.title == test.title);
            rows.push(vec![
                stand.set_up.name.clone(),
                test.title.clone(),
                repeats.count().to_string(),
            ]);
        }
    }
    rows
}

/// What an ideal machine would record of each test; those that it cannot run are noted and left out.
fn candidates(
    offers: Vec<Offer>,
    machine: &MachineFile,
    shop: &Shop,
    control: &fake_cnc::Config,
    notes: &mut Vec<String>,
) -> (Vec<Offer>, Vec<Candidate>) {
    let mut kept = Vec::new();
    let mut all = Vec::new();
    for offer in offers {
        match candidate(&offer, machine, shop, control) {
            Ok(candidate) => {
                all.push(candidate);
                kept.push(offer);
            }
            Err(error) => notes.push(format!("Left out: {}: {error:#}.", offer.title)),
        }
    }
    (kept, all)
}

fn candidate(
    offer: &Offer,
    machine: &MachineFile,
    shop: &Shop,
    control: &fake_cnc::Config,
) -> Result<Candidate> {
    let (session, minutes) = if let Some(bar) = &offer.bar {
        for text in offer.programs.values() {
            programs::check(machine, text)?;
        }
        ballbar(machine, bar).context("a plane without axes")?
    } else {
        let plan = Plan::from_yaml(&plan_of(offer))?;
        let run = dry_run::dry_run(
            &plan,
            offer.programs.clone(),
            machine,
            control,
            dry_run::Beside::default(),
        )?;
        let mut session = run.session;
        if let Some(heat) = offer.heat {
            temperatures::foresee(&mut session, machine, heat);
        }
        (session, run.minutes)
    };
    Ok(Candidate {
        title: offer.title.clone(),
        session,
        minutes: minutes + SETTLE_MIN,
        set_up: offer.set_up.name.clone(),
        most_repeats: offer.most_repeats,
        is_at_hand: shop.has(offer.set_up.means),
    })
}

/// A plan of one test.
fn plan_of(offer: &Offer) -> String {
    let steps: Vec<String> = offer
        .steps
        .iter()
        .map(|step| format!("  - {step}\n"))
        .collect();
    format!("title: one test\nsteps:\n{}", steps.concat())
}

/// The folder of a design, for messages of the command line.
pub fn needed(out: Option<&PathBuf>) -> Result<&Path> {
    out.map(PathBuf::as_path).ok_or_else(|| {
        refused(
            "preflight",
            "--design needs -o FOLDER: the programme is written there",
        )
    })
}

#[cfg(test)]
mod tests;
