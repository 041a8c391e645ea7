//! A trial on a shop's session: its tables are imported by the product, or its shift is a bag; it is diagnosed as a process.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use gap_diagnosis::GapReport;
use gap_diagnosis::report::Status;
use node_runtime::text_file;
use trials::shop::{Answer, Shift, ShopEffect, ShopSession, answer};
use trials::{Truth, Verdict, judge};

use crate::blind;
use crate::seal::Seal;
use crate::trial::{How, Which};
use crate::{later, session_bag};

mod page;
mod ten_lines;

pub use page::Table;

/// The report, where the diagnosis may write.
const REPORT: &str = "told/gap.json";

/// The bag of a shift.
const BAG: &str = "shift";

/// A report with its page, or the reason why the session was refused.
type Reported = Result<(GapReport, String), String>;

/// Makes a trial; `tell` gets the seal of its truth first.
///
/// # Errors
/// When it cannot be made.
pub fn trial(how: &How, which: &Which<'_>, tell: &dyn Fn(&str)) -> Result<Vec<Verdict>> {
    let began = Instant::now();
    let Some(session) = ShopSession::draw(which.arm, which.seed, which.index) else {
        bail!("arm {} is none of a shop", which.arm);
    };
    let name = which.name();
    let folder = how.out.join(&name);
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    std::fs::create_dir_all(&folder).with_context(|| format!("{}", folder.display()))?;
    write(&session, &folder)?;
    let mut truth = Truth::of_a_shop(which.arm, which.seed, which.index, session.truth);
    truth.bare_um = bare_um(&session.shift, &session.machine, &truth)?;
    let seal = Seal::write(&how.sealed, &name, &truth)?;
    tell(&format!("sealed {name}: sha256 {}", seal.sha256));
    let making_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let mut names: Vec<&str> = session
        .tables
        .iter()
        .map(|table| table.name.as_str())
        .collect();
    let is_shift = session.shift.is_some();
    let reported = match imported(&folder, &names)? {
        Ok(()) => {
            names.extend(is_shift.then_some(BAG));
            diagnosed(&folder, &names, is_shift)?
        }
        Err(reason) => Err(reason),
    };
    let diagnosis_s = began.elapsed().as_secs_f64();
    let later_closed = match (&session.shift, &reported) {
        (Some(shift), Ok((report, _))) => later_closed(shift, &session.machine, report, &folder)?,
        _ => None,
    };
    if !how.keep {
        std::fs::remove_dir_all(&folder)?;
    }
    let (said, shop, refused) = match &reported {
        Ok((report, page)) => (Some(judge(report)), Some(answer(report, page)), None),
        Err(reason) => (None, None, Some(reason.clone())),
    };
    Ok(vec![Verdict {
        truth: seal.open()?,
        truth_sha256: seal.sha256.clone(),
        commit: abbe::COMMIT.to_owned(),
        said,
        refused,
        diagnosis_s,
        making_s,
        ablated: None,
        baselines: BTreeMap::new(),
        likeness: vec![],
        later_closed,
        second: None,
        shop: shop.filter(|answer| *answer != Answer::default()),
    }])
}

fn write(session: &ShopSession, folder: &Path) -> Result<()> {
    std::fs::write(folder.join("machine.yaml"), &session.machine)?;
    for table in &session.tables {
        std::fs::write(folder.join(format!("{}.csv", table.name)), &table.text)?;
        std::fs::write(folder.join(format!("{}.yaml", table.name)), &table.map)?;
    }
    if let Some(shift) = &session.shift {
        let bag = folder.join(BAG);
        session_bag::write_samples(&shift.samples, &bag, session.machine.clone())?;
        blind::make_found(folder)?;
    }
    blind::make_told(folder)
}

/// What is left of a shift that hides nothing, where one hides something, µm.
fn bare_um(shift: &Option<Shift>, machine: &str, truth: &Truth) -> Result<Option<f64>> {
    let hides = truth.shop.as_ref().is_some_and(|it| !it.effects.is_empty());
    let Some(shift) = shift.as_ref().filter(|_| hides) else {
        return Ok(None);
    };
    let recording = blind::taken(machine, &shift.bare)?;
    Ok(recording.ok().as_ref().and_then(blind::left_um))
}

/// What the named effects close on the shift once more, where each of them stands alone.
fn later_closed(
    shift: &Shift,
    machine: &str,
    report: &GapReport,
    folder: &Path,
) -> Result<Option<f64>> {
    let has = |status: Status| report.causes.iter().any(|cause| cause.status == status);
    if !has(Status::Named) || has(Status::Set) {
        return Ok(None);
    }
    let found = blind::read_found(folder)?;
    let recording = blind::taken(machine, &shift.later)?;
    Ok(recording.ok().and_then(|it| later::closed_on(&it, &found)))
}

/// Makes a bag of every table, named as it is.
fn imported(folder: &Path, names: &[&str]) -> Result<Result<(), String>> {
    let program = std::env::current_exe().context("path of this program")?;
    for name in names {
        let output = Command::new(&program)
            .args([
                "import",
                &format!("{name}.csv"),
                "--map",
                &format!("{name}.yaml"),
            ])
            .args(["--machine", "machine.yaml", "-o", name])
            .current_dir(folder)
            .env_clear()
            .stdin(Stdio::null())
            .output()
            .context("abbe import")?;
        if !blind::is_done(output.status) {
            let told = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            return Ok(Err(format!("import: {told}")));
        }
    }
    Ok(Ok(()))
}

/// Diagnoses the bags, with the whole page: thermometers stand in its remarks alone.
fn diagnosed(folder: &Path, names: &[&str], writes_machine: bool) -> Result<Reported> {
    let mut process = blind::process(folder)?;
    if writes_machine {
        process.command.args(["--write-machine", blind::FOUND]);
    }
    let output = process
        .command
        .args(names)
        .args(["--machine", "machine.yaml", "--json", REPORT, "--full"])
        .output()
        .context("abbe diagnose")?;
    if !blind::is_done(output.status) {
        let told = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        return Ok(Err(format!("diagnose: {told}")));
    }
    let text = text_file::bytes(&folder.join(REPORT))?;
    let report = serde_json::from_slice(&text).context("report of abbe diagnose")?;
    Ok(Ok((
        report,
        String::from_utf8_lossy(&output.stdout).into_owned(),
    )))
}

/// A hidden effect in a line.
pub fn effect_words(effect: &ShopEffect) -> String {
    let (size, unit, d) = (effect.size, &effect.unit, effect.d);
    let open = if effect.is_resolvable() { "" } else { ", open" };
    format!("{} {size:.2} {unit} (D {d:.0}{open})", effect.what)
}
