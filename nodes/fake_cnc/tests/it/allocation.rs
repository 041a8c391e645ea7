//! A servo period allocates nothing.

use fake_cnc::{Cnc, Config, Input, Output, Plant, PlantFile};
use machine::MachineFile;
use metrology::stamp::Span;
use metrology::{Stage, Stamp};

const MACHINE: &str = include_str!("../../../../launch_configs/first_run/machine.yaml");
const PLANT: &str = include_str!("../../../../launch_configs/first_run/plant.yaml");

#[test]
fn periods_in_motion_and_between_motions_allocate_nothing() {
    let mut machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    // A temperature reading carries its sensor's name and so allocates, every 10 s.
    machine.temperature_sensors.clear();
    let plant = Plant::new(&machine, &PlantFile::from_yaml(PLANT).unwrap()).unwrap();
    let mut cnc = Cnc::new(&Config::default(), &machine, plant).unwrap();
    let mut out: Vec<Output> = Vec::with_capacity(64);
    let mut now = Stamp::from_nanos(0);
    cnc.step(now, Input::Tick, &mut out).unwrap();
    let request = Input::RunProgram {
        goal: 1,
        text: "F2000 G1 X50\nG3 X50 Y20 J10\nG1 X0 A-20\nG4 P0.1\nG0 X0 Y0\nG1 C30 Z10\nM2"
            .to_owned(),
        name: String::new(),
    };
    cnc.step(now, request, &mut out).unwrap();
    let mut busy = 0;
    let counted = allocation_counter::measure(|| {
        for _ in 0..3000 {
            out.clear();
            now += Span::from_nanos(1_000_000);
            cnc.step(now, Input::Tick, &mut out).unwrap();
            busy += u32::from(!cnc.idle());
        }
    });
    assert_eq!(counted.count_total, 0, "{counted:?}");
    assert_eq!(
        busy, 3000,
        "the program must last longer than the measurement"
    );
    let control = allocation_counter::measure(|| drop(std::hint::black_box(Box::new(busy))));
    assert_eq!(control.count_total, 1, "the counter must count");
}
