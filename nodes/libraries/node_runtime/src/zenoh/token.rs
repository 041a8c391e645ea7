//! What `rmw_zenoh_cpp` writes into keys: of topics, and of the liveliness tokens that are its ROS graph.
//!
//! ```text
//!   <domain>/<name>/<type>/<hash>                                              topic or service
//!   @ros2_lv/<domain>/<session>/<node>/<node>/NN/<enclave>/<namespace>/<name>  node
//!   @ros2_lv/<domain>/<session>/<node>/<end>/<kind>/<enclave>/<namespace>/<name>/<topic>/<type>/<hash>/<qos>
//! ```
//!
//! In a token every `/` of a name is a `%`, and nothing at all too. An end's GID is the 128-bit XXH3 of its
//! token. Source: design.md of ros2/rmw_zenoh.

use abbe_msgs::{Durability, Qos, Reliability};
use xxhash_rust::xxh3::xxh3_128;

use crate::network::Guid;

/// What ROS's tokens begin with.
const SPACE: &str = "@ros2_lv";

/// Stands where a type's hash is not known.
const NO_HASH: &str = "TypeHashNotSupported";

/// What depth 0 means.
const DEPTH_OF_ZERO: u32 = 42;

/// What a token stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Node,
    Publisher,
    Subscription,
    Server,
    Client,
}

impl Kind {
    const ALL: [(Self, &str); 5] = [
        (Self::Node, "NN"),
        (Self::Publisher, "MP"),
        (Self::Subscription, "MS"),
        (Self::Server, "SS"),
        (Self::Client, "SC"),
    ];

    fn code(self) -> &'static str {
        let mut all = Self::ALL.iter();
        all.find(|(kind, _)| *kind == self)
            .map_or("", |(_, code)| code)
    }

    fn of(code: &str) -> Option<Self> {
        let mut all = Self::ALL.iter();
        all.find(|(_, known)| *known == code).map(|(kind, _)| *kind)
    }
}

/// Everything under this is a token of a domain.
pub(super) fn all_of(domain: u16) -> String {
    format!("{SPACE}/{domain}/**")
}

/// The key of a topic or service; without a hash, of every hash.
pub(super) fn key(domain: u16, name: &str, dds_type: &str, hash: Option<&str>) -> String {
    let name = name.trim_matches('/');
    format!("{domain}/{name}/{dds_type}/{}", hash.unwrap_or("*"))
}

/// The hash as who sends must write it.
pub(super) fn sent_hash(hash: Option<&str>) -> &str {
    hash.unwrap_or(NO_HASH)
}

fn mangled(name: &str) -> String {
    match name {
        "" => "%".to_owned(),
        name => name.replace('/', "%"),
    }
}

/// A node of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NodeId {
    pub session: String,
    pub node: u64,
    pub namespace: String,
    pub name: String,
}

impl NodeId {
    /// Its full name.
    pub fn fully_qualified(&self) -> String {
        format!("{}/{}", self.namespace.trim_end_matches('/'), self.name)
    }
}

/// The token of a node.
pub(super) fn of_node(domain: u16, id: &NodeId) -> String {
    let NodeId {
        session,
        node,
        namespace,
        name,
    } = id;
    let (kind, namespace) = (Kind::Node.code(), mangled(namespace));
    format!("{SPACE}/{domain}/{session}/{node}/{node}/{kind}/%/{namespace}/{name}")
}

/// An end of a topic or service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct End {
    pub kind: Kind,
    /// Of the topic or service.
    pub name: String,
    pub dds_type: String,
    pub hash: Option<String>,
    pub qos: Qos,
}

/// The token of a node's end.
pub(super) fn of_end(domain: u16, id: &NodeId, number: u64, end: &End) -> String {
    let NodeId {
        session,
        node,
        namespace,
        name,
    } = id;
    let (kind, namespace, topic) = (end.kind.code(), mangled(namespace), mangled(&end.name));
    let (dds_type, hash, qos) = (
        &end.dds_type,
        sent_hash(end.hash.as_deref()),
        written(end.qos),
    );
    format!(
        "{SPACE}/{domain}/{session}/{node}/{number}/{kind}/%/{namespace}/{name}/{topic}/{dds_type}/{hash}/{qos}"
    )
}

/// What an end is called in attachments and by everybody who sees its token.
pub(super) fn guid(token: &str) -> Guid {
    xxh3_128(token.as_bytes()).to_le_bytes()
}

/// Quality of service: what differs from reliable, volatile, keep last; the depth always.
fn written(qos: Qos) -> String {
    let reliability = match qos.reliability {
        Reliability::Reliable => "",
        Reliability::BestEffort => "2",
    };
    let durability = match qos.durability {
        Durability::Volatile => "",
        Durability::TransientLocal => "1",
    };
    format!("{reliability}:{durability}:,{}:,:,:,,", qos.depth)
}

fn read(qos: &str) -> Option<Qos> {
    let mut groups = qos.split(':');
    let (reliability, durability) = (groups.next()?, groups.next()?);
    let (_, depth) = groups.next()?.split_once(',')?;
    Some(Qos {
        reliability: match reliability {
            "2" => Reliability::BestEffort,
            _ => Reliability::Reliable,
        },
        durability: match durability {
            "1" => Durability::TransientLocal,
            _ => Durability::Volatile,
        },
        depth: match depth.parse() {
            Ok(0) | Err(_) => DEPTH_OF_ZERO,
            Ok(depth) => depth,
        },
    })
}

/// Reads a token; an end is `None` for a node's own. `None` for what is no token of ROS.
pub(super) fn parse(token: &str) -> Option<(NodeId, Option<End>)> {
    let parts: Vec<&str> = token.split('/').collect();
    let [
        space,
        _domain,
        session,
        node,
        _number,
        kind,
        _enclave,
        namespace,
        name,
        rest @ ..,
    ] = parts.as_slice()
    else {
        return None;
    };
    if *space != SPACE {
        return None;
    }
    let demangled = |name: &str| name.replace('%', "/");
    let id = NodeId {
        session: (*session).to_owned(),
        node: node.parse().ok()?,
        namespace: demangled(namespace),
        name: demangled(name),
    };
    let kind = Kind::of(kind)?;
    if kind == Kind::Node {
        return Some((id, None));
    }
    // Something may follow the quality of service.
    let [name, dds_type, hash, qos, ..] = rest else {
        return None;
    };
    let end = End {
        kind,
        name: demangled(name),
        dds_type: (*dds_type).to_owned(),
        hash: (*hash != NO_HASH).then(|| (*hash).to_owned()),
        qos: read(qos)?,
    };
    Some((id, Some(end)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRING: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

    fn talker(namespace: &str) -> NodeId {
        NodeId {
            session: "8b20917502ee955ac4476e0266340d5c".to_owned(),
            node: 0,
            namespace: namespace.to_owned(),
            name: "talker".to_owned(),
        }
    }

    fn chatter(kind: Kind, qos: Qos) -> End {
        End {
            kind,
            name: "/chatter".to_owned(),
            dds_type: "std_msgs::msg::dds_::String_".to_owned(),
            hash: Some(STRING.to_owned()),
            qos,
        }
    }

    #[test]
    fn tokens_and_keys_are_those_of_the_design_of_rmw_zenoh() {
        let depth_7 = Qos {
            depth: 7,
            ..Qos::RELIABLE
        };
        let end = chatter(Kind::Publisher, depth_7);
        let token = of_end(0, &talker("/"), 10, &end);
        let expected = format!(
            "@ros2_lv/0/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/\
             std_msgs::msg::dds_::String_/{STRING}/::,7:,:,:,,"
        );
        assert_eq!(token, expected);
        let node = "@ros2_lv/0/8b20917502ee955ac4476e0266340d5c/0/0/NN/%/%/talker";
        assert_eq!(of_node(0, &talker("/")), node);
        let dds_type = "std_msgs::msg::dds_::String_";
        let expected = format!("2/robot1/chatter/{dds_type}/{STRING}");
        assert_eq!(key(2, "/robot1/chatter", dds_type, Some(STRING)), expected);
        assert_eq!(all_of(42), "@ros2_lv/42/**");
    }

    #[test]
    fn what_was_written_is_read_again() {
        for qos in [Qos::LATCHED, Qos::RELIABLE_DEEP, Qos::SENSOR_DATA] {
            for kind in [
                Kind::Publisher,
                Kind::Subscription,
                Kind::Server,
                Kind::Client,
            ] {
                let end = chatter(kind, qos);
                let token = of_end(7, &talker("/cell/a"), 3, &end);
                assert_eq!(
                    parse(&token),
                    Some((talker("/cell/a"), Some(end))),
                    "{token}"
                );
            }
        }
        let node = of_node(7, &talker("/cell"));
        assert_eq!(parse(&node), Some((talker("/cell"), None)));
    }

    #[test]
    fn tokens_of_others_are_read_whatever_they_leave_out() {
        let whole = "@ros2_lv/0/a/0/1/MS/%/%/x/%t/p::msg::dds_::T_/TypeHashNotSupported/2:1:2,0:,:,:1,,/backends:";
        let end = parse(whole).unwrap().1.unwrap();
        assert_eq!((end.hash, end.qos.depth), (None, 42));
        let found = (end.qos.reliability, end.qos.durability);
        assert_eq!(found, (Reliability::BestEffort, Durability::TransientLocal));
        for bad in [
            "",
            "@ros2_lv/0/a",
            "0/chatter/x/y",
            "@ros2_lv/0/a/0/1/XX/%/%/x",
            "@ros2_lv/0/a/0/1/MP/%/%/x/%t",
        ] {
            assert_eq!(parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn a_guid_is_the_128_bit_hash_of_its_token_low_half_first() {
        // XXH3-128 of nothing is 99aa06d3014798d8 6001c324468d497f, as the specification's test vectors have it.
        let expected = [0x7f, 0x49, 0x8d, 0x46, 0x24, 0xc3, 0x01, 0x60];
        assert_eq!(guid("")[..8], expected);
        assert_eq!(
            guid("")[8..],
            [0xd8, 0x98, 0x47, 0x01, 0xd3, 0x06, 0xaa, 0x99]
        );
    }
}
