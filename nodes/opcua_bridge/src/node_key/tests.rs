//! Which keys are read, and how they are written again.

use proptest::prelude::*;

use super::*;

#[test]
fn identifiers_of_all_four_kinds_are_read_with_their_namespace() {
    let of = |namespace: &str, identifier| NodeKey::Id {
        namespace: namespace.to_owned(),
        identifier,
    };
    for (text, key) in [
        ("i=2258", of("", Identifier::Number(2258))),
        (
            "nsu=http://a.example/;s=/Channel[1];x=1",
            of(
                "http://a.example/",
                Identifier::Text("/Channel[1];x=1".to_owned()),
            ),
        ),
        (
            "nsu=urn:a%3Bb;i=4294967295",
            of("urn:a;b", Identifier::Number(u32::MAX)),
        ),
        (
            "nsu=urn:a;g=72962B91-FA75-4AE6-8D28-B404DC7DAF63",
            of(
                "urn:a",
                Identifier::Guid("72962b91-fa75-4ae6-8d28-b404dc7daf63".to_owned()),
            ),
        ),
        (
            "nsu=urn:a;b=M/RbKBsRVkePCePcx24oRA==",
            of(
                "urn:a",
                Identifier::Bytes("M/RbKBsRVkePCePcx24oRA==".to_owned()),
            ),
        ),
    ] {
        assert_eq!(NodeKey::read(text).as_ref(), Ok(&key), "{text}");
        assert_eq!(NodeKey::read(&key.text()).as_ref(), Ok(&key), "{text}");
    }
}

#[test]
fn what_is_no_key_is_refused_with_what_belongs_there() {
    for (text, said) in [
        ("", "must be nsu=URI;s=TEXT"),
        ("Xabs", "must be nsu=URI;s=TEXT"),
        ("s=", "must be nsu=URI;s=TEXT"),
        ("nsu=urn:a", "must be nsu=URI;s=TEXT"),
        ("nsu=;i=1", "must be nsu=URI;s=TEXT"),
        ("é", "must be nsu=URI;s=TEXT"),
        ("i=-1", "\"-1\" must be a number from 0 to 4294967295"),
        ("i=+1", "\"+1\" must be a number"),
        ("i=4294967296", "must be a number from 0"),
        ("g=1234", "\"1234\" must be a GUID"),
        ("b=abc", "\"abc\" must be bytes in Base64"),
        (
            "ns=2;s=Axis.X",
            "write nsu=URI;s=Axis.X (abbe import-map prints it)",
        ),
        ("/", "a path must have 1 to 16 names"),
        ("/a//b", "a path must have 1 to 16 names"),
        ("/a/", "a path must have 1 to 16 names"),
        ("/a&", "a path must have 1 to 16 names"),
        ("/mt:a", "prefix \"mt\": must be one of ua"),
        (
            &format!("/{}", "a/".repeat(17)),
            "a path must have 1 to 16 names",
        ),
        (&"s".repeat(4097), "4097 bytes: at most 4096"),
    ] {
        let flaw = NodeKey::read(text).unwrap_err().to_string();
        assert!(flaw.contains(said), "{text}: {flaw}");
    }
}

#[test]
fn a_path_names_namespaces_by_prefix_and_any_node_by_a_star() {
    let key = NodeKey::read("/machinery:Machines/*/Feed&/Rate/machine_tool:&*").unwrap();
    let NodeKey::Path(steps) = &key else {
        panic!("{key:?}");
    };
    let machinery = "http://opcfoundation.org/UA/Machinery/";
    assert!(steps[0].holds(machinery, "Machines"));
    assert!(!steps[0].holds("urn:other", "Machines"));
    assert!(steps[1].holds("urn:other", "Mill 7"));
    assert!(steps[2].holds("urn:other", "Feed/Rate"));
    assert_eq!(steps[3].name.as_deref(), Some("*"));
    assert_eq!(NodeKey::read(&key.text()), Ok(key));
}

#[test]
fn a_namespace_is_the_same_with_and_without_a_bar_at_its_end() {
    let NodeKey::Path(steps) = NodeKey::read("/cnc:CncAxisList").unwrap() else {
        panic!("a path is read as one");
    };
    for uri in [
        "http://opcfoundation.org/UA/CNC",
        "http://opcfoundation.org/UA/CNC/",
    ] {
        assert!(steps[0].holds(uri, "CncAxisList"), "{uri}");
    }
    assert!(!steps[0].holds("http://opcfoundation.org/UA/", "CncAxisList"));
}

#[test]
fn an_index_follows_its_namespace_wherever_the_server_puts_it() {
    let key = NodeKey::read("nsu=urn:mill;s=x").unwrap();
    let server =
        |uris: &[&str]| -> Vec<String> { uris.iter().map(|uri| (*uri).to_owned()).collect() };
    assert_eq!(
        key.index(&server(&["ua", "urn:server", "urn:mill"])),
        Some(2)
    );
    assert_eq!(
        key.index(&server(&["ua", "urn:server", "urn:new", "urn:mill"])),
        Some(3)
    );
    assert_eq!(key.index(&server(&["ua", "urn:server"])), None);
    assert_eq!(NodeKey::read("i=85").unwrap().index(&[]), Some(0));
}

proptest! {
    /// Whatever stands in a mapping is read or refused, and what is read is written as it was meant.
    #[test]
    fn any_text_is_a_key_or_refused(text in "[/:&*;=nsuigb%a-f0-9 é.-]{0,40}") {
        if let Ok(key) = NodeKey::read(&text) {
            prop_assert_eq!(NodeKey::read(&key.text()), Ok(key));
        }
    }

    #[test]
    fn any_identifier_comes_back_from_its_text(uri in "[ -~]{1,30}", name in "[ -~]{1,30}", number: u32) {
        for identifier in [Identifier::Text(name.clone()), Identifier::Number(number)] {
            let key = NodeKey::Id { namespace: uri.clone(), identifier };
            prop_assert_eq!(NodeKey::read(&key.text()), Ok(key));
        }
    }
}
