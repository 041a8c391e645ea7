//! `abbe preflight PLAN|SCENARIO`: what the recordings of a plan will determine, before anything is measured.
//!
//! Two questions are asked of it: which errors of geometry its recordings over a plate determine, and which effects
//! of the catalogue a diagnosis of everything that it records would find, from what size, and tell apart.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::Args;
use gap_diagnosis::GapConfig;
use gap_diagnosis::preflight::preflight;
use metrology::bound::{Bound, BoundError};
use metrology::number::number;
use metrology::stamp::NANOS_PER_S;
use nalgebra::Vector3;
use reports::gap::planned;
use reports::screen::Made;
use reports::section::Section;
use reports::terminal::{self, Part, Room};
use reports::whole_file::{self, Form, Output, check_outputs};
use reports::{self, Report};

pub mod design;
mod dry_run;
mod floors;
mod ideal;
mod outcome;
mod programme;
mod requests;
mod size;
mod wanted;
mod warming;

use design::{Means, Mounting};
use floors::FloorArgument;
use outcome::Seen;
use programme::{Planned, Programme};
use wanted::Proposal;

use crate::SOFTWARE;
use crate::tell::tell;
use crate::usage::{GREATEST_NUMBER, refused};

/// Components that are wanted, and offsets tried for each: every pair is a fit.
const ASKED: Bound = Bound::at_most(100);

/// Arguments of `abbe preflight`.
#[derive(Args)]
pub struct Preflight {
    /// Folder of a scenario, or a plan file.
    #[arg(required_unless_present = "design")]
    what: Option<PathBuf>,
    /// Machine file; a scenario has its own.
    #[arg(long)]
    machine: Option<PathBuf>,
    /// Design a programme for the machine file, and write it as a scenario's folder.
    #[arg(long, requires = "machine", requires = "with", requires = "out", conflicts_with_all = ["what", "want", "head_offset"])]
    design: bool,
    /// Minutes that a designed programme may take, set-ups included.
    #[arg(
        long,
        value_name = "MIN",
        default_value_t = 20.0,
        allow_negative_numbers = true,
        requires = "design"
    )]
    minutes: f64,
    /// Instruments at hand for a designed programme: probe, grid, laser, ballbar, scales, thermometers.
    #[arg(long, value_name = "INSTRUMENTS", value_delimiter = ',', requires = "design", value_parser = design::means)]
    with: Vec<Means>,
    /// Minutes that one set-up of an instrument takes; may be repeated.
    #[arg(long, value_name = "INSTRUMENT=MIN", requires = "design", value_parser = design::mounting)]
    mounting: Vec<Mounting>,
    /// File of effects that are likelier than others, with their sizes and weights.
    #[arg(long, value_name = "FILE", requires = "design")]
    likely: Option<PathBuf>,
    /// Folder of the designed programme; new or empty.
    #[arg(short, long, value_name = "FOLDER", requires = "design")]
    out: Option<PathBuf>,
    /// Component or coefficient that has to be determined, e.g. `ECY` or `EXX1`; may be repeated.
    #[arg(long, value_name = "NAME")]
    want: Vec<String>,
    /// Offset of the head that could be mounted, besides those of the machine file: X,Y,Z in mm; may be repeated.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = offset)]
    head_offset: Vec<Vector3<f64>>,
    /// Standard uncertainty of a station, of which that of each error follows.
    #[arg(
        long,
        value_name = "UM",
        default_value_t = 0.1,
        allow_negative_numbers = true
    )]
    station_uncertainty_um: f64,
    /// Noise to assume of an instrument (motor, scale, grid, radial, length, touch): of a reading and between
    /// runs, in µm; may be repeated.
    #[arg(long, value_name = "INSTRUMENT=READING/BETWEEN", value_parser = floors::argument)]
    floor: Vec<FloorArgument>,
    /// Write the page as one HTML file.
    #[arg(long)]
    html: Option<PathBuf>,
    /// The figures as JSON instead of text.
    #[arg(long)]
    json: bool,
    /// Print every table, instead of the answer and three tables in at most 40 lines.
    #[arg(long)]
    full: bool,
}

impl Preflight {
    /// Refuses more questions than a preflight answers.
    fn bounded(&self) -> Result<(), BoundError> {
        let asked = [
            ("--want", self.want.len()),
            ("--head-offset", self.head_offset.len()),
        ];
        asked
            .into_iter()
            .try_for_each(|(option, n)| ASKED.check_amount(|| option.to_owned(), "values", n))
    }

    /// Tells rank, what is determined and what to add, and what a diagnosis would find.
    ///
    /// # Errors
    /// When plan, machine, a wanted name or a number (exit code 2) cannot be used.
    pub fn execute(self) -> Result<ExitCode> {
        let html = self.html.iter();
        let html = html.map(|page| Output::new("--html", page.clone(), Form::Html));
        let inputs = [&self.what, &self.machine, &self.likely];
        let inputs = inputs.into_iter().filter_map(|input| input.as_deref());
        check_outputs(&html.collect::<Vec<_>>(), inputs)?;
        if self.design {
            return self.execute_design();
        }
        let Some(what) = self.what.as_deref() else {
            return Err(refused(
                "preflight",
                "a plan file or the folder of a scenario is needed",
            ));
        };
        let u_um = self.station_uncertainty_um;
        if !(u_um > 0.0 && u_um <= GREATEST_NUMBER) {
            let reason = format!(
                "--station-uncertainty-um {}: must be finite and above 0, at most {} µm",
                number(u_um),
                number(GREATEST_NUMBER)
            );
            return Err(refused("preflight", reason));
        }
        self.bounded()
            .map_err(|error| refused("preflight", error))?;
        if let Some(name) = self.head_offset.first().filter(|_| self.want.is_empty()) {
            let reason = format!(
                "--head-offset {},{},{} does nothing without --want: it is an offset to try for a component that is wanted",
                name.x, name.y, name.z
            );
            return Err(refused("preflight", reason));
        }
        floors::check(&self.floor).map_err(|reason| refused("preflight", reason))?;
        let plan = Planned::read(what, self.machine.as_deref())?;
        size::check(&plan.plan, &plan.programs, &plan.machine)?;
        let geometry = self.geometry(&plan, u_um * 1e-3)?;
        let mut page = self.foreseen(&plan)?;
        page.screen.made = Some(foreseen_now(&plan.machine.name, plan.what()));
        let title = format!("Preflight: {}", plan.plan.title);
        if let Some(path) = &self.html {
            let sections = geometry.sections();
            let body = maud::html! {
                (page.screen.html(&title))
                (page.body)
                @for section in &sections { (section.html()) }
            };
            let html = reports::html(&title, &body);
            whole_file::write(path, &html)?;
        }
        self.tell(&plan, &geometry, page)
    }

    /// What a diagnosis would find of what the plan, and what its nodes ask for, would record.
    fn foreseen(&self, plan: &Planned) -> Result<Report> {
        let run = dry_run::dry_run(
            &plan.plan,
            plan.programs.clone(),
            &plan.machine,
            &plan.control,
            plan.beside(),
        )?;
        size::check_touches(run.touches)?;
        let floors = floors::floors(&plan.machine, &self.floor);
        let forecast = preflight(&plan.machine, &run.session, &floors, &GapConfig::default())?;
        let rehearsed = planned::Rehearsed {
            minutes: run.minutes,
            requested: run.requested,
            is_unasked: plan.is_unasked(),
            changes_k: &run.changes_k,
        };
        Ok(planned::page(
            "What a diagnosis would find",
            &forecast,
            &rehearsed,
        ))
    }

    /// As [`design::Wanted::execute`].
    fn execute_design(&self) -> Result<ExitCode> {
        floors::check(&self.floor).map_err(|reason| refused("preflight", reason))?;
        let Some(machine) = self.machine.as_deref() else {
            return Err(refused("preflight", "--design needs --machine FILE"));
        };
        let floored: Vec<_> = self.floor.iter().map(FloorArgument::instrument).collect();
        design::Wanted {
            machine,
            minutes: self.minutes,
            with: &self.with,
            mounting: &self.mounting,
            likely: self.likely.as_deref(),
            floors: &|machine: &machine::MachineFile| floors::floors(machine, &self.floor),
            floored: &floored,
            out: design::needed(self.out.as_ref())?,
            html: self.html.as_deref(),
            json: self.json,
            full: self.full,
        }
        .execute()
    }

    /// Text or JSON on standard output.
    fn tell(&self, plan: &Planned, geometry: &Geometry, page: Report) -> Result<ExitCode> {
        if self.json {
            let mut figures = geometry.figures();
            figures["plan"] = plan.plan.title.clone().into();
            figures["gap"] = page.figures;
            tell!("{}", serde_json::to_string_pretty(&figures)?);
        } else if self.full {
            for section in geometry.sections() {
                tell!("{}", section.terminal());
            }
            tell!("{}", page.terminal());
        } else {
            let sections = geometry.sections();
            let parts: Vec<Part> = sections.iter().map(Part::of).chain(page.parts).collect();
            let room = Room::with_page(self.html.as_deref());
            tell!("{}", terminal::short(&page.lines, &parts, &room));
        }
        Ok(ExitCode::SUCCESS)
    }

    fn geometry(&self, plan: &Planned, station_uncertainty_mm: f64) -> Result<Geometry> {
        let Some(programme) = Programme::of(plan, station_uncertainty_mm)? else {
            if let Some(name) = self.want.first() {
                bail!(
                    "--want {name}: the plan of {} has no grid step, so no error of geometry is looked at",
                    plan.what()
                );
            }
            return Ok(Geometry(None));
        };
        let seen = Seen::of(&programme)?;
        let proposals = self
            .want
            .iter()
            .map(|name| Proposal::find(&programme, name, &self.head_offset))
            .collect::<Result<Vec<_>>>()?;
        Ok(Geometry(Some((programme, seen, proposals))))
    }
}

/// Machine, plan, time and software of a page on which nothing was measured.
pub(crate) fn foreseen_now(machine: &str, plan: &str) -> Made {
    let now_nanos = chrono::Utc::now().timestamp().saturating_mul(NANOS_PER_S);
    Made::of_plan(SOFTWARE, machine, plan, now_nanos)
}

/// What the recordings over a plate will determine, where there are any.
struct Geometry(Option<(Programme, Seen, Vec<Proposal>)>);

impl Geometry {
    fn sections(&self) -> Vec<Section> {
        let Some((programme, seen, proposals)) = &self.0 else {
            return vec![];
        };
        let mut sections = vec![seen.section(programme)];
        sections.extend(proposals.iter().map(Proposal::section));
        sections
    }

    fn figures(&self) -> serde_json::Value {
        let Some((programme, seen, proposals)) = &self.0 else {
            return serde_json::json!({ "seen": null, "wanted": [] });
        };
        serde_json::json!({
            "chain": programme.kinematics.chain().to_string(),
            "station_uncertainty_mm": programme.station_uncertainty_mm,
            "seen": seen.figures(),
            "wanted": proposals.iter().map(Proposal::figures).collect::<Vec<_>>(),
        })
    }
}

fn offset(text: &str) -> Result<Vector3<f64>, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| {
            part.trim()
                .parse()
                .map_err(|_| format!("\"{part}\" is no number"))
        })
        .collect::<Result<_, String>>()?;
    match numbers.as_slice() {
        [x, y, z] if numbers.iter().all(|n| n.abs() <= GREATEST_NUMBER) => {
            Ok(Vector3::new(*x, *y, *z))
        }
        _ => Err(format!(
            "\"{text}\": three finite numbers X,Y,Z in mm are needed, each at most 1e12"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_a_hundred_questions_are_refused_before_the_plan_is_read() {
        for (want, offsets, option) in [(101, 1, "--want"), (1, 101, "--head-offset")] {
            let preflight = Preflight {
                what: Some("no such plan".into()),
                machine: None,
                design: false,
                minutes: 20.0,
                with: Vec::new(),
                mounting: Vec::new(),
                likely: None,
                out: None,
                want: vec!["EXX".to_owned(); want],
                head_offset: vec![Vector3::zeros(); offsets],
                station_uncertainty_um: 0.1,
                floor: Vec::new(),
                html: None,
                json: false,
                full: false,
            };
            let refused = preflight.execute().unwrap_err().to_string();
            let wanted = format!("{option}: 101 values: at most 100");
            assert!(refused.contains(&wanted), "{refused}");
        }
        for wrong in ["grid=1e300/0.3", "grid=0.1/inf", "grid=0/0.3"] {
            let refused = floors::argument(wrong).unwrap_err();
            assert!(
                refused.contains("must be a number from 0.0001 to 10000 µm"),
                "{refused}"
            );
        }
    }

    #[test]
    fn a_head_offset_is_three_numbers() {
        assert_eq!(offset("-60, 0,12.5"), Ok(Vector3::new(-60.0, 0.0, 12.5)));
        assert!(offset("60,0").unwrap_err().contains("three finite numbers"));
        assert!(offset("60,a,0").unwrap_err().contains("\"a\" is no number"));
    }
}
