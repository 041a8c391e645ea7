//! What is planned: the machine, the recordings over its plate, and how they will be fitted.

use std::path::Path;

use anyhow::{Context, Result, bail};
use grid_encoder::GridEncoderConfig;
use grid_encoder::identify::IdentifyOptions;
use grid_encoder::preflight::planned_through;
use grid_encoder::recording::{Place, Recording};
use machine::{Kinematics, MachineFile};
use node_runtime::Setup;
use node_runtime::arguments::Arguments;
use sequencer::{Plan, recordings};

use crate::launch::LaunchNode;
use crate::scenario::Scenario;

/// A plan's recordings, ready to be judged.
pub struct Programme {
    /// Title of the plan.
    pub title: String,
    /// The machine file.
    pub machine: MachineFile,
    /// Its chain.
    pub kinematics: Kinematics,
    /// Planned recordings, in order.
    pub recordings: Vec<Recording>,
    /// How they will be fitted.
    pub options: IdentifyOptions,
    /// Of a station, mm.
    pub station_uncertainty_mm: f64,
}

impl Programme {
    /// Reads a scenario's folder, or a plan file beside a machine file.
    ///
    /// # Errors
    /// With file and place when something is missing or wrong, or no recording is planned.
    pub fn read(what: &Path, machine: Option<&Path>, station_uncertainty_mm: f64) -> Result<Self> {
        let (plan, own_machine, config) = if what.is_dir() {
            of_scenario(what)?
        } else {
            (plan_file(what)?, None, GridEncoderConfig::default())
        };
        let machine = match (machine, own_machine) {
            (Some(path), _) => machine_file(path)?,
            (None, Some(own)) => own,
            (None, None) => bail!("plan {}: --machine FILE is needed", what.display()),
        };
        let kinematics = Kinematics::new(&machine).context("machine file: chain")?;
        let planned =
            recordings(&plan, &machine).with_context(|| format!("plan of {}", what.display()))?;
        if planned.is_empty() {
            bail!(
                "plan of {}: it has no grid step, so nothing to look at",
                what.display()
            );
        }
        let recordings: Vec<Recording> = planned
            .iter()
            .map(|one| {
                let place = Place::from(&one.segment);
                planned_through(
                    one.segment.run,
                    &place,
                    &one.places_mm,
                    station_uncertainty_mm,
                )
            })
            .collect();
        let options = config.options_for(kinematics.chain(), &recordings)?;
        Ok(Self {
            title: plan.title,
            machine,
            kinematics,
            recordings,
            options,
            station_uncertainty_mm,
        })
    }
}

type Parts = (Plan, Option<MachineFile>, GridEncoderConfig);

/// Plan and machine of the sequencer, parameters of the grid encoder.
fn of_scenario(folder: &Path) -> Result<Parts> {
    let scenario = Scenario::read(folder)?;
    let find = |exec: &str| scenario.nodes.iter().find(|node| node.exec == exec);
    let Some(sequencer) = find("sequencer") else {
        bail!(
            "scenario {}: it launches no sequencer, so there is no plan",
            folder.display()
        );
    };
    let setup = setup(sequencer)?;
    let (path, text) = setup.file_text("plan_file")?;
    let plan = Plan::from_yaml(&text).with_context(|| format!("plan {}", path.display()))?;
    let machine = machine_file(&setup.file_path("machine_file")?)?;
    let config = match find("grid_encoder") {
        Some(node) => self::setup(node)?.config()?,
        None => GridEncoderConfig::default(),
    };
    Ok((plan, Some(machine), config))
}

fn setup(node: &LaunchNode) -> Result<Setup> {
    let made = Setup::new(&node.exec, &Arguments::parse(node.ros_args())?);
    made.with_context(|| format!("node {}", node.name))
}

fn plan_file(path: &Path) -> Result<Plan> {
    let text = std::fs::read_to_string(path).with_context(|| format!("plan {}", path.display()))?;
    Plan::from_yaml(&text).with_context(|| format!("plan {}", path.display()))
}

fn machine_file(path: &Path) -> Result<MachineFile> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("machine file {}", path.display()))?;
    Ok(MachineFile::parse(&text, &path.display().to_string())?)
}
