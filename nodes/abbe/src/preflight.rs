//! `abbe preflight PLAN|SCENARIO`: what the recordings of a plan will determine, before anything is measured.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::Args;
use nalgebra::Vector3;

mod outcome;
mod programme;
mod wanted;

use outcome::Seen;
use programme::Programme;
use wanted::Proposal;

/// Arguments of `abbe preflight`.
#[derive(Args)]
pub struct Preflight {
    /// Folder of a scenario, or a plan file.
    what: PathBuf,
    /// Machine file; a scenario has its own.
    #[arg(long)]
    machine: Option<PathBuf>,
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
    /// The figures as JSON instead of text.
    #[arg(long)]
    json: bool,
}

impl Preflight {
    /// Tells rank, what is determined and what to add.
    ///
    /// # Errors
    /// When plan, machine or a wanted name cannot be used.
    pub fn execute(self) -> Result<ExitCode> {
        let u_um = self.station_uncertainty_um;
        if !(u_um.is_finite() && u_um > 0.0) {
            bail!("--station-uncertainty-um {u_um}: must be finite and above 0");
        }
        let programme = Programme::read(&self.what, self.machine.as_deref(), u_um * 1e-3)?;
        let seen = Seen::of(&programme)?;
        let proposals = self
            .want
            .iter()
            .map(|name| Proposal::find(&programme, name, &self.head_offset))
            .collect::<Result<Vec<_>>>()?;
        if self.json {
            let figures = serde_json::json!({
                "plan": programme.title,
                "chain": programme.kinematics.chain().to_string(),
                "station_uncertainty_mm": programme.station_uncertainty_mm,
                "seen": seen.figures(),
                "wanted": proposals.iter().map(Proposal::figures).collect::<Vec<_>>(),
            });
            println!("{}", serde_json::to_string_pretty(&figures)?);
        } else {
            println!("{}", seen.section(&programme).terminal());
            for proposal in &proposals {
                println!("{}", proposal.section().terminal());
            }
        }
        Ok(ExitCode::SUCCESS)
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
        [x, y, z] if numbers.iter().all(|n| n.is_finite()) => Ok(Vector3::new(*x, *y, *z)),
        _ => Err(format!(
            "\"{text}\": three finite numbers X,Y,Z in mm are needed"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_offset_is_three_numbers() {
        assert_eq!(offset("-60, 0,12.5"), Ok(Vector3::new(-60.0, 0.0, 12.5)));
        assert!(offset("60,0").unwrap_err().contains("three finite numbers"));
        assert!(offset("60,a,0").unwrap_err().contains("\"a\" is no number"));
    }
}
