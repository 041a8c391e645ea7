//! Reading CDR by its definition.

use proptest::prelude::*;
use recorder::{ReflectError, Reflector, Value};

const PAIR: &str = "uint8 a\nuint32 b\nfloat64[] c\n";

fn pair() -> Reflector {
    Reflector::new("t_msgs/msg/Pair", "ros2msg", PAIR).unwrap()
}

fn field(value: &Value, index: usize) -> Value {
    let Value::Message(fields) = value else {
        panic!("{value:?}");
    };
    fields[index].1.clone()
}

#[test]
fn numbers_stand_at_multiples_of_their_size_in_both_byte_orders() {
    let little = [
        0, 1, 0, 0, // little endian
        7, 0, 0, 0, // a, 3 bytes of padding
        1, 2, 0, 0, // b
        1, 0, 0, 0, // one item
        0, 0, 0, 0, // padding to 8
        0, 0, 0, 0, 0, 0, 0xf0, 0x3f,
    ];
    let big = [
        0, 0, 0, 0, 7, 0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0x3f, 0xf0, 0, 0, 0, 0, 0, 0,
    ];
    for bytes in [&little, &big] {
        let value = pair().decode(bytes).unwrap();
        assert_eq!(field(&value, 0), Value::Uint(7));
        assert_eq!(field(&value, 1), Value::Uint(0x201));
        assert_eq!(field(&value, 2), Value::List(vec![Value::Float64(1.0)]));
    }
}

#[test]
fn parts_of_services_are_found_by_their_kind() {
    let definition = "std_srvs/srv/SetBool_Request[<=1] request\n".to_owned()
        + &"=".repeat(80)
        + "\nMSG: std_srvs/srv/SetBool_Request\nbool data\n";
    let event = Reflector::new("std_srvs/srv/SetBool_Event", "ros2msg", &definition).unwrap();
    let value = event.decode(&[0, 1, 0, 0, 1, 0, 0, 0, 1]).unwrap();
    let request = Value::Message(vec![("data".into(), Value::Bool(true))]);
    assert_eq!(field(&value, 0), Value::List(vec![request]));
}

#[test]
fn what_the_definition_does_not_describe_is_refused_by_field() {
    let short = pair().decode(&[0, 1, 0, 0, 7, 0]).unwrap_err();
    assert!(matches!(short, ReflectError::Short { field, .. } if field == "b"));
    let huge = [0, 1, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0, 255, 255, 255, 255];
    let huge = pair().decode(&huge).unwrap_err();
    assert!(matches!(huge, ReflectError::Short { field, .. } if field == "c"));
    let parameter_list = pair().decode(&[0, 3, 0, 0]).unwrap_err();
    assert!(matches!(parameter_list, ReflectError::Encapsulation { .. }));
    let left = [0, 1, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 9, 9, 9, 9];
    assert_eq!(
        pair().decode(&left).unwrap_err(),
        ReflectError::Left { left: 4 }
    );
}

#[test]
fn definitions_that_are_absent_open_or_endless_are_refused() {
    let cases = [
        ("", "", "only ros2msg is read"),
        (
            "ros2msg",
            "t_msgs/Other x\n",
            "t_msgs/Other is used and not defined",
        ),
        (
            "ros2msg",
            "Loop next\n",
            "t_msgs/Loop is nested deeper than 32",
        ),
        ("ros2msg", "wstring x\n", "type wstring is not read"),
        ("ros2msg", "int32[ x\n", "definition of t_msgs/Loop"),
    ];
    for (encoding, text, words) in cases {
        let error = Reflector::new("t_msgs/msg/Loop", encoding, text).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn prop_no_bytes_and_no_text_panic(
        bytes in proptest::collection::vec(any::<u8>(), 0..64),
        text in "(u?int(8|32) |string(<=[0-9])? |Loop(\\[\\])? |[a-z=#\\[\\]<\"'/ ]{0,6}|[ -~é\n]{0,4}|\n){0,12}",
    ) {
        let _ = pair().decode(&bytes);
        if let Ok(reflector) = Reflector::new("t_msgs/msg/Loop", "ros2msg", &text) {
            let _ = reflector.decode(&bytes);
        }
    }
}
