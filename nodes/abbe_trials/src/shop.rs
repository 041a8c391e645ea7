//! A trial on a shop's session: its tables are imported by the product, and diagnosed as a process.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use gap_diagnosis::GapReport;
use node_runtime::text_file;
use trials::shop::{Answer, ShopEffect, ShopSession, answer};
use trials::{Truth, Verdict, judge};

use crate::blind;
use crate::seal::Seal;
use crate::trial::{How, Which};

mod page;
mod ten_lines;

pub use page::Table;

/// The report, where the diagnosis may write.
const REPORT: &str = "told/gap.json";

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
    let truth = Truth::of_a_shop(which.arm, which.seed, which.index, session.truth);
    let seal = Seal::write(&how.sealed, &name, &truth)?;
    tell(&format!("sealed {name}: sha256 {}", seal.sha256));
    let making_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let names: Vec<&str> = session
        .tables
        .iter()
        .map(|table| table.name.as_str())
        .collect();
    let reported = match imported(&folder, &names)? {
        Ok(()) => diagnosed(&folder, &names)?,
        Err(reason) => Err(reason),
    };
    let diagnosis_s = began.elapsed().as_secs_f64();
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
        later_closed: None,
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
    blind::make_told(folder)
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
fn diagnosed(folder: &Path, names: &[&str]) -> Result<Reported> {
    let mut process = blind::process(folder)?;
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
