//! A thermometer's offset against the tolerance of platinum sensors.

use machine::twin::Channel;

use crate::past::{predict, read, stands, warm};
use crate::scene::bench;

#[test]
fn val_thermometer_offset_pt100_class_b() {
    let machine = bench();
    // 0.30 K + 0.005 |t|: 0.30 K at 0 and 0.60 K at 60 degC.
    for (degc, limit_k) in [(0.0, 0.30), (60.0, 0.60)] {
        let history = warm(5.0, 10, "air", &|_| degc);
        let mut run = stands(&[20.0], |_| [0.0; 3]);
        read(&mut run, &Channel::Thermometer(String::from("air")));
        let given = [("offset_k", 0.4), ("free_slope_percent", 0.5)];
        let seen = predict(
            &machine,
            &history,
            &run,
            ("thermometer_offset", "air"),
            &given,
        );
        assert!((seen[0] - limit_k).abs() < 1e-12, "{seen:?}");
    }
}
