//! Values that a machine reports: nothing is lost on the wire, and what means nothing is refused.

use abbe_msgs::{Message, Wire, msg};
use metrology::Stamp;
use metrology::sample::{MachineValue, Quantity, Verdict};

fn value(quantity: Quantity, verdict: Verdict, value: f64) -> MachineValue {
    MachineValue {
        received_at: Stamp::from_nanos(1_480_411_729_444_000_000),
        machine_at: Stamp::from_nanos(1_480_411_729_000_000_001),
        name: "spindle".to_owned(),
        quantity,
        verdict,
        value,
        text: "43".to_owned(),
    }
}

#[test]
fn every_quantity_and_verdict_comes_back_and_a_feed_is_in_metres_on_the_wire() {
    for quantity in Quantity::ALL {
        for verdict in [Verdict::Good, Verdict::Impossible, Verdict::Unconfirmed] {
            let number = if quantity.is_number() {
                512.0
            } else {
                f64::NAN
            };
            let sent = value(quantity, verdict, number);
            let wire = msg::MachineValue::from_inner(&sent);
            let expected = if quantity == Quantity::Feed {
                0.512
            } else {
                number
            };
            assert!(wire.value.total_cmp(&expected).is_eq(), "{wire:?}");
            let back = wire.into_inner().unwrap();
            assert_eq!(format!("{back:?}"), format!("{sent:?}"));
        }
    }
}

#[test]
fn a_number_that_is_none_and_codes_beyond_the_last_are_refused() {
    let good = msg::MachineValue::from_inner(&value(Quantity::Load, Verdict::Good, 0.5));
    let complaint = |change: &dyn Fn(&mut msg::MachineValue)| {
        let mut wrong = good.clone();
        change(&mut wrong);
        wrong.to_inner().unwrap_err().to_string()
    };
    let name = msg::MachineValue::TYPE_NAME;
    let said = complaint(&|m| m.value = f64::NAN);
    assert_eq!(said, format!("{name}: value: NaN: must be a finite number"));
    let said = complaint(&|m| m.quantity = 8);
    assert_eq!(said, format!("{name}: quantity: value 8: must be 0 to 7"));
    let said = complaint(&|m| m.verdict = 3);
    assert_eq!(said, format!("{name}: verdict: value 3: must be 0 to 2"));
    let said = complaint(&|m| m.machine_stamp.nanosec = 1_000_000_000);
    assert!(
        said.starts_with(&format!("{name}: machine_stamp")),
        "{said}"
    );
}
