//! Every node as it is launched, with a recording of what good publishers say to it.

use std::path::Path;

use abbe_tests::program::root;
use anyhow::Result;
use node_runtime::arguments::Arguments;
use node_runtime::{Node, Setup};

/// A node, how it is launched, and what it hears.
pub struct Tried {
    /// Its folder.
    pub exec: &'static str,
    pub build: fn(&Setup) -> Result<Box<dyn Node>>,
    /// Parameter file below `launch_configs`, or the file's own text.
    pub parameters: &'static str,
    /// Recording in `bags`; empty: it hears no topic.
    pub bag: &'static str,
    /// How far its time goes on with a stranger's message, ns.
    pub pace_nanos: i64,
    /// Share of all strangers' messages.
    pub share: u64,
}

macro_rules! tried {
    ($($exec:ident from $shell:ident: $parameters:expr, $bag:literal, $pace:literal, $share:literal;)*) => {
        pub const TRIED: &[Tried] = &[$(Tried {
            exec: stringify!($exec),
            build: $shell::node,
            parameters: $parameters,
            bag: $bag,
            pace_nanos: $pace,
            share: $share,
        }),*];
    };
}

tried! {
    probe from probe_node: "cold_reference/probe.yaml", "cold_reference", 1_000_000, 10;
    latency_calibrator from latency_calibrator_node: "cold_reference/latency_calibrator.yaml", "cold_reference", 1_000_000, 10;
    grid_encoder from grid_encoder_node: "grid_xy/grid_encoder.yaml", "grid_circles", 1_000_000, 10;
    rotary_axes from rotary_axes_node: "five_axis/rotary_axes.yaml", "rotary_sphere", 10_000_000, 2;
    thermal_model from thermal_model_node: "cold_reference/thermal_model.yaml", "host_clocks", 20_000_000, 10;
    axis_compensation from axis_compensation_node: "dual_loop/axis_compensation.yaml", "dual_loop", 1_000_000, 10;
    axis_compensation from axis_compensation_node: "five_axis/axis_compensation.yaml", "rotary_sphere", 1_000_000, 10;
    gap_diagnosis from gap_diagnosis_node: "gap_first/gap_diagnosis.yaml", "rosbag2_touches", 1_000_000, 8;
    machine_frames from machine_frames_node: "five_axis/machine_frames.yaml", "cold_reference", 10_000_000, 4;
    host_clock from host_clock_node: "three_hosts/clock_of_models.yaml", "host_clocks", 1_000_000, 5;
    host_clock from host_clock_node: "three_hosts/clock_of_controller.yaml", "host_clocks", 1_000_000, 4;
    sequencer from sequencer_node: "cold_reference/sequencer.yaml", "cold_reference", 20_000_000, 4;
    sequencer from sequencer_node: WITHOUT_A_PLAN, "cold_reference", 20_000_000, 3;
    fake_cnc from fake_cnc_node: "cold_reference/fake_cnc.yaml", "lifecycle", 2_000_000, 3;
    linuxcnc_bridge from linuxcnc_bridge_node: NOBODY_LISTENS, "lifecycle", 2_000_000, 1;
}

/// Nodes that hear no topic of ours and offer at most calls without a field. What the recorder listens to it does not read;
/// what an MTConnect machine sends is tried by `tests/fuzz`.
pub const WITHOUT_EARS: [&str; 5] = [
    "live_view",
    "mtconnect_bridge",
    "opcua_bridge",
    "recorder",
    "replayer",
];

const WITHOUT_A_PLAN: &str = "
/**:
  ros__parameters:
    machine_file: HOME/first_run/machine.yaml
";

const NOBODY_LISTENS: &str = "
/**:
  ros__parameters:
    machine_file: HOME/linuxcnc_latency/machine.yaml
    joints: [X, \"Y\", Z]
    prepare: observe
    connection: {port: 9}
    compensation: {limit_um: 200.0, limit_arcsec: 60.0, stale_after_ms: 1000.0}
";

impl Tried {
    /// Its parameter file.
    pub fn file(&self, home: &Path) -> String {
        let configs = root().join("launch_configs");
        let file = if self.parameters.contains('\n') {
            let text = self
                .parameters
                .replace("HOME", &configs.display().to_string());
            let file = home.join("parameters.yaml");
            std::fs::write(&file, text).unwrap();
            file
        } else {
            configs.join(self.parameters)
        };
        file.display().to_string()
    }

    pub fn node(&self, home: &Path) -> Box<dyn Node> {
        let words = ["--ros-args", "--params-file", &self.file(home)].map(str::to_owned);
        let setup = Setup::new(self.exec, &Arguments::parse(words).unwrap()).unwrap();
        (self.build)(&setup).unwrap()
    }
}
