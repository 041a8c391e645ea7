//! What is planned: the plan, the machine and its control; the recordings over its plate, and how they will be fitted.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use grid_encoder::GridEncoderConfig;
use grid_encoder::identify::IdentifyOptions;
use grid_encoder::preflight::planned_through;
use grid_encoder::recording::{Place, Recording};
use machine::file::AxisEntry;
use machine::{Kinematics, MachineFile};
use metrology::Axis;
use node_runtime::text_file::{self, Comments};
use sequencer::{Plan, Step, recordings};
use sequencer_node::read_plan;
use thermal_model::ThermalModelConfig;

use super::dry_run::Beside;
use crate::scenario::Scenario;

/// Where an axis stands at the begin of a plan without a scenario, as a share of its travel: the head up,
/// the others in the middle.
const START: [f64; 3] = [0.5, 0.5, 0.9];

/// A plan with everything that it is run with.
pub struct Planned {
    /// The plan.
    pub plan: Plan,
    /// Texts of the programs that it names.
    pub programs: BTreeMap<String, String>,
    /// The machine file.
    pub machine: MachineFile,
    /// Parameters of the control.
    pub control: fake_cnc::Config,
    /// Parameters of the fit.
    pub fit: GridEncoderConfig,
    /// Parameters of the thermal model, where the scenario has one: it asks for block cycles.
    pub thermal_model: Option<ThermalModelConfig>,
    /// As the user gave it.
    what: String,
}

impl Planned {
    /// Reads a scenario's folder, or a plan file beside a machine file.
    ///
    /// # Errors
    /// With file and place when something is missing or wrong.
    pub fn read(what: &Path, machine: Option<&Path>) -> Result<Self> {
        let mut planned = if what.is_dir() {
            of_scenario(what, machine)?
        } else {
            let plan = plan_file(what)?;
            let Some(machine) = machine else {
                bail!("plan {}: --machine FILE is needed", what.display());
            };
            let machine = machine_file(machine)?;
            Self {
                programs: programs(&plan, what)?,
                plan,
                control: control(&machine),
                machine,
                fit: GridEncoderConfig::default(),
                thermal_model: None,
                what: String::new(),
            }
        };
        planned.what = what.display().to_string();
        Ok(planned)
    }

    /// What happens beside the plan.
    pub const fn beside(&self) -> Beside<'_> {
        Beside {
            warms: true,
            thermal_model: self.thermal_model.as_ref(),
        }
    }

    /// Whether production serves block cycles that nobody is known to ask for.
    pub fn is_unasked(&self) -> bool {
        let serves = |step: &Step| {
            matches!(
                step,
                Step::Produce {
                    serve_updates: true,
                    ..
                }
            )
        };
        self.thermal_model.is_none() && self.plan.steps.iter().any(serves)
    }

    /// Scenario or plan, as the user gave it.
    pub fn what(&self) -> &str {
        &self.what
    }
}

/// A plan's recordings over a plate, ready to be judged.
pub struct Programme {
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
    /// The recordings of a plan; none where it has no step over a plate.
    ///
    /// # Errors
    /// When one cannot be made on this machine, or a parameter of the fit is wrong.
    pub fn of(planned: &Planned, station_uncertainty_mm: f64) -> Result<Option<Self>> {
        let machine = planned.machine.clone();
        let kinematics = Kinematics::new(&machine).context("machine file: chain")?;
        let of_plan = recordings(&planned.plan, &machine);
        let of_plan = of_plan.with_context(|| format!("plan of {}", planned.what))?;
        if of_plan.is_empty() {
            return Ok(None);
        }
        let recordings: Vec<Recording> = of_plan
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
        let options = planned.fit.options_for(kinematics.chain(), &recordings)?;
        Ok(Some(Self {
            machine,
            kinematics,
            recordings,
            options,
            station_uncertainty_mm,
        }))
    }
}

/// Plan and machine of the sequencer, parameters of the control and of the grid encoder.
fn of_scenario(folder: &Path, machine: Option<&Path>) -> Result<Planned> {
    let scenario = Scenario::read(folder)?;
    let find = |exec: &str| scenario.nodes.iter().find(|node| node.exec == exec);
    let Some(sequencer) = find("sequencer") else {
        bail!(
            "scenario {}: it launches no sequencer, so there is no plan",
            folder.display()
        );
    };
    let setup = sequencer.setup()?;
    let (path, text) = setup.file_text("plan_file")?;
    let plan = read_plan(&text, &path)?;
    let own = setup.file_path("machine_file")?;
    let machine = machine_file(machine.unwrap_or(&own))?;
    Ok(Planned {
        programs: programs(&plan, &path)?,
        plan,
        control: match find("fake_cnc") {
            Some(node) => node.setup()?.config()?,
            None => control(&machine),
        },
        machine,
        fit: match find("grid_encoder") {
            Some(node) => node.setup()?.config()?,
            None => GridEncoderConfig::default(),
        },
        thermal_model: match find("thermal_model") {
            Some(node) => Some(node.setup()?.config()?),
            None => None,
        },
        what: String::new(),
    })
}

/// The control of a machine whose scenario has none: it allows twice what the machine's own loops leave at rapid speed.
pub fn control(machine: &MachineFile) -> fake_cnc::Config {
    let usual = fake_cnc::Config::default();
    let (mut mm, mut deg) = (
        usual.following_error_limit_mm,
        usual.following_error_limit_deg,
    );
    let lag = |feed_per_min: f64, feedforward: f64, gain_per_s: f64| {
        2.0 * feed_per_min / 60.0 * (1.0 - feedforward) / gain_per_s
    };
    for entry in machine.axes.values() {
        match entry {
            AxisEntry::Linear(a) => {
                let own = lag(
                    a.feed_limit_mm_min,
                    a.velocity_feedforward,
                    a.position_gain_per_s,
                );
                mm = mm.max(own);
            }
            AxisEntry::Rotary(a) => {
                let own = lag(
                    a.feed_limit_deg_min,
                    a.velocity_feedforward,
                    a.position_gain_per_s,
                );
                deg = deg.max(own);
            }
        }
    }
    fake_cnc::Config {
        start_mm: start_mm(machine),
        following_error_limit_mm: mm,
        following_error_limit_deg: deg,
        ..usual
    }
}

fn start_mm(machine: &MachineFile) -> BTreeMap<Axis, f64> {
    let linear = machine.axes.iter().filter_map(|(axis, entry)| match entry {
        AxisEntry::Linear(linear) => Some((*axis, linear.travel_mm)),
        AxisEntry::Rotary(_) => None,
    });
    let start =
        |(axis, [low, high]): (Axis, [f64; 2])| (axis, low + (high - low) * START[axis.index()]);
    linear.map(start).collect()
}

/// Texts of the programs that a plan names; paths are relative to the plan's file.
fn programs(plan: &Plan, plan_path: &Path) -> Result<BTreeMap<String, String>> {
    let folder = plan_path.parent().unwrap_or_else(|| Path::new(""));
    let named = plan.steps.iter().filter_map(|step| match step {
        Step::Produce { program, .. } | Step::Verify { program, .. } | Step::Run { program } => {
            Some(program)
        }
        _ => None,
    });
    let read = |program: &String| {
        let path: PathBuf = folder.join(program);
        let text = text_file::read(&path, Comments::Gcode)
            .with_context(|| format!("plan {}", plan_path.display()))?;
        Ok((program.clone(), text))
    };
    named.map(read).collect()
}

fn plan_file(path: &Path) -> Result<Plan> {
    let text = text_file::yaml(path).context("plan")?;
    read_plan(&text, path)
}

fn machine_file(path: &Path) -> Result<MachineFile> {
    let file = text_file::yaml_file(path).context("machine file")?;
    Ok(MachineFile::parse(
        &file.text,
        &file.path.display().to_string(),
    )?)
}
