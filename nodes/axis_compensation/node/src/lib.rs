//! ROS shell of the axis compensation.

use abbe_msgs::std_srvs::srv::{SetBoolRequest, SetBoolResponse};
use abbe_msgs::topics;
use anyhow::Result;
use axis_compensation::geometric::GeometrySource;
use axis_compensation::{AxisCompensationConfig, AxisCompensationStage, Input, Output};
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::{Lifecycle, Node, Setup, Wiring};

mod conditions;

/// Time between two looks at what is stale.
const TICK: Span = Span::from_nanos(10_000_000);

/// What a busy computer adds to the time of a last fade, s.
const BUSY_S: f64 = 1.0;

/// Builds the node.
///
/// # Errors
/// When a parameter or the machine file is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: AxisCompensationConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    let built = setup.built(AxisCompensationStage::new(&config, &machine))?;
    let stage = built.inactive();
    let fresh = stage.clone();
    let wind_down = Span::from_secs_f64(config.wind_down_s() + BUSY_S);
    let at_rest = |output: &Output| *output == Output::AtRest;
    let lifecycle = Lifecycle::new(config.autostart, wind_down, Input::Active, at_rest).cleaned_up(
        move |stage: &mut AxisCompensationStage| {
            stage.clone_from(&fresh);
            Ok(())
        },
    );
    Ok(Wiring::new(setup.name(), parameters, stage)
        .saved()
        .on(&topics::AXES_STATE, Input::State)
        .on(&topics::THERMAL_MODEL, |model| {
            Input::Model(Box::new(model))
        })
        .on(&topics::GEOMETRY_MODEL, |model| {
            Input::Geometry(GeometrySource::Linear, Box::new(model))
        })
        .on(&topics::GEOMETRY_ROTARY, |model| {
            Input::Geometry(GeometrySource::Rotary, Box::new(model))
        })
        .on(&topics::TEST_SEGMENT, |segment| {
            Input::Segment(Box::new(segment))
        })
        .every(TICK, || Input::Tick)
        .service(
            &topics::SET_COMPENSATION,
            |request: SetBoolRequest| Input::Enable(request.data),
            switched,
        )
        .publish(&topics::COMPENSATION, |output| match output {
            Output::Compensation(compensation) => Some(compensation),
            _ => None,
        })
        .publish(&topics::POSITIONING_TABLE, |output| match output {
            Output::Table(table) => Some(&**table),
            _ => None,
        })
        .diagnose(conditions::condition)
        .shutdown(|| Input::Shutdown, |output| *output == Output::FadedOut)
        .wound_down_within(wind_down)
        .managed(lifecycle))
}

fn switched(outcome: Result<&[Output], &str>) -> SetBoolResponse {
    SetBoolResponse {
        success: outcome.is_ok(),
        message: outcome.err().unwrap_or_default().to_owned(),
    }
}
