//! Keys of the mapping: which node a key is, whatever index its namespace has today.
//!
//! ```text
//!   nsu=http://www.siemens.com/sinumerik;s=/Channel/State/actFeedRateIpo    namespace and identifier
//!   i=2258                                                                  namespace 0
//!   /machinery:Machines/*/machine_tool:Monitoring/*/machine_tool:FeedOverride
//! ```
//!
//! An identifier is `i=` a number, `s=` a text, `g=` a GUID or `b=` bytes in Base64. A path begins at `Objects` and goes by
//! browse names; a prefix names a companion namespace ([`PREFIXES`]), no prefix means any, `*` is any node, and a bar,
//! a colon or `&` within a name has `&` before it. All nodes along a path are followed; exactly one must remain.
//!
//! # References
//! \[1\] OPC 10000-6, 5.1.12 and 5.2.2.9 (text of a NodeId, `nsu=`, `%3B` for a semicolon). \[2\] OPC 10000-4, annex A.2
//! (`&` in a relative path).

/// Bytes of a key at most; the standard bounds texts of identifiers by 4,096.
pub const KEY_LIMIT: usize = 4096;
/// Steps of a path at most.
pub const STEPS_LIMIT: usize = 16;

/// Prefixes of paths with their namespaces, as the published node sets have them.
pub const PREFIXES: [(&str, &str); 8] = [
    ("ua", "http://opcfoundation.org/UA/"),
    ("di", "http://opcfoundation.org/UA/DI/"),
    ("ia", "http://opcfoundation.org/UA/IA/"),
    ("machinery", "http://opcfoundation.org/UA/Machinery/"),
    ("machine_tool", "http://opcfoundation.org/UA/MachineTool/"),
    ("jobs", "http://opcfoundation.org/UA/Machinery/Jobs/"),
    ("cnc", "http://opcfoundation.org/UA/CNC"),
    ("isa95", "http://opcfoundation.org/UA/ISA95-JOBCONTROL_V2/"),
];

/// An identifier within its namespace.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Identifier {
    /// `i=`
    Number(u32),
    /// `s=`
    Text(String),
    /// `g=`, in small letters.
    Guid(String),
    /// `b=`, in Base64.
    Bytes(String),
}

/// One step of a path.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Step {
    /// Namespace of the browse name; `None`: any.
    pub namespace: Option<String>,
    /// Browse name; `None`: any node.
    pub name: Option<String>,
}

/// A node, however the mapping names it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum NodeKey {
    /// By namespace and identifier.
    Id {
        /// URI of the namespace; empty: namespace 0.
        namespace: String,
        /// Identifier in it.
        identifier: Identifier,
    },
    /// By browse names from `Objects` on.
    Path(Vec<Step>),
}

/// Why a text is no node key.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KeyFlaw {
    /// Too long.
    #[error("{length} bytes: at most {limit}", limit = KEY_LIMIT)]
    Long {
        /// Its length.
        length: usize,
    },
    /// An index stands where a URI must.
    #[error(
        "a namespace's index changes with the server: write nsu=URI;{rest} (abbe import-map prints it)"
    )]
    Index {
        /// The identifier.
        rest: String,
    },
    /// Neither an identifier nor a path.
    #[error("must be nsu=URI;s=TEXT (or i=, g=, b=), or a path /NAME/NAME from Objects on")]
    Form,
    /// The numeric identifier is no number.
    #[error("{text:?} must be a number from 0 to 4294967295")]
    Number {
        /// What stands there.
        text: String,
    },
    /// The identifier is no GUID.
    #[error("{text:?} must be a GUID such as 72962b91-fa75-4ae6-8d28-b404dc7daf63")]
    Guid {
        /// What stands there.
        text: String,
    },
    /// The identifier is no base64.
    #[error("{text:?} must be bytes in Base64")]
    Bytes {
        /// What stands there.
        text: String,
    },
    /// A prefix that nobody knows.
    #[error(
        "prefix {prefix:?}: must be one of ua, di, ia, machinery, machine_tool, jobs, cnc, isa95"
    )]
    Prefix {
        /// The prefix.
        prefix: String,
    },
    /// A path without steps, with an empty one, or with too many.
    #[error("a path must have 1 to {limit} names, none empty", limit = STEPS_LIMIT)]
    Steps,
}

impl NodeKey {
    /// Reads a key of the mapping.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(text: &str) -> Result<Self, KeyFlaw> {
        if text.len() > KEY_LIMIT {
            return Err(KeyFlaw::Long { length: text.len() });
        }
        if let Some(path) = text.strip_prefix('/') {
            return read_path(path);
        }
        if let Some(indexed) = text.strip_prefix("ns=") {
            let rest = indexed.split_once(';').map_or("s=TEXT", |(_, rest)| rest);
            let rest = rest.to_owned();
            return Err(KeyFlaw::Index { rest });
        }
        let (namespace, identifier) = match text.strip_prefix("nsu=") {
            Some(rest) => rest.split_once(';').ok_or(KeyFlaw::Form)?,
            None => ("", text),
        };
        if namespace.is_empty() && text.starts_with("nsu=") {
            return Err(KeyFlaw::Form);
        }
        Ok(Self::Id {
            namespace: namespace.replace("%3B", ";").replace("%25", "%"),
            identifier: read_identifier(identifier)?,
        })
    }

    /// The key as the mapping has it.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Id {
                namespace,
                identifier,
            } => {
                let uri = namespace.replace('%', "%25").replace(';', "%3B");
                let before = match uri.as_str() {
                    "" => String::new(),
                    uri => format!("nsu={uri};"),
                };
                match identifier {
                    Identifier::Number(number) => format!("{before}i={number}"),
                    Identifier::Text(text) => format!("{before}s={text}"),
                    Identifier::Guid(text) => format!("{before}g={text}"),
                    Identifier::Bytes(text) => format!("{before}b={text}"),
                }
            }
            Self::Path(steps) => steps.iter().map(step_text).collect(),
        }
    }

    /// The index that its namespace has on a server; `None`: the server has it not. A path has none.
    #[must_use]
    pub fn index(&self, namespaces: &[String]) -> Option<u16> {
        match self {
            Self::Id { namespace, .. } if namespace.is_empty() => Some(0),
            Self::Id { namespace, .. } => index_of(namespaces, namespace),
            Self::Path(_) => None,
        }
    }
}

/// Index of a namespace on a server.
#[must_use]
pub fn index_of(namespaces: &[String], uri: &str) -> Option<u16> {
    let at = namespaces.iter().position(|known| known == uri)?;
    u16::try_from(at).ok()
}

impl Step {
    /// Whether a node with this browse name is one; a bar at the end of a namespace makes no other of it, since the node set
    /// of OPC 40502 has none and its text has one.
    #[must_use]
    pub fn holds(&self, namespace: &str, name: &str) -> bool {
        let is_name = self.name.as_deref().is_none_or(|wanted| wanted == name);
        let of = self.namespace.as_deref();
        is_name && of.is_none_or(|wanted| bare(wanted) == bare(namespace))
    }
}

/// A namespace without the bar at its end.
fn bare(uri: &str) -> &str {
    uri.strip_suffix('/').unwrap_or(uri)
}

fn read_identifier(text: &str) -> Result<Identifier, KeyFlaw> {
    let (kind, rest) = text.split_at_checked(2).ok_or(KeyFlaw::Form)?;
    let own = || rest.to_owned();
    match kind {
        "i=" => {
            let digits = rest.bytes().all(|byte| byte.is_ascii_digit());
            let number = rest.parse().ok().filter(|_| digits);
            number
                .map(Identifier::Number)
                .ok_or_else(|| KeyFlaw::Number { text: own() })
        }
        "s=" if !rest.is_empty() => Ok(Identifier::Text(own())),
        "g=" => {
            let lengths: Vec<usize> = rest.split('-').map(str::len).collect();
            let is_hex = |byte: u8| byte.is_ascii_hexdigit() || byte == b'-';
            if lengths == [8, 4, 4, 4, 12] && rest.bytes().all(is_hex) {
                Ok(Identifier::Guid(rest.to_ascii_lowercase()))
            } else {
                Err(KeyFlaw::Guid { text: own() })
            }
        }
        "b=" => {
            let letters = rest.trim_end_matches('=');
            let is_letter = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'+' || byte == b'/';
            let is_whole = !rest.is_empty() && rest.len().is_multiple_of(4);
            if is_whole && rest.len() - letters.len() <= 2 && letters.bytes().all(is_letter) {
                Ok(Identifier::Bytes(own()))
            } else {
                Err(KeyFlaw::Bytes { text: own() })
            }
        }
        _ => Err(KeyFlaw::Form),
    }
}

fn read_path(text: &str) -> Result<NodeKey, KeyFlaw> {
    let mut steps = Vec::new();
    let (mut prefix, mut name) = (None, String::new());
    let mut letters = text.chars();
    let mut has_escape = false;
    loop {
        match letters.next() {
            Some('&') => {
                name.push(letters.next().ok_or(KeyFlaw::Steps)?);
                has_escape = true;
            }
            Some(':') if prefix.is_none() => {
                prefix = Some(std::mem::take(&mut name));
                has_escape = false;
            }
            Some(letter) if letter != '/' => name.push(letter),
            end => {
                if name.is_empty() || steps.len() == STEPS_LIMIT {
                    return Err(KeyFlaw::Steps);
                }
                let is_any = name == "*" && !has_escape;
                let name = Some(std::mem::take(&mut name)).filter(|_| !is_any);
                let namespace = prefix.take().map(namespace_of).transpose()?;
                steps.push(Step { namespace, name });
                has_escape = false;
                if end.is_none() {
                    return Ok(NodeKey::Path(steps));
                }
            }
        }
    }
}

fn namespace_of(prefix: String) -> Result<String, KeyFlaw> {
    let known = PREFIXES.iter().find(|(known, _)| *known == prefix);
    known
        .map(|(_, uri)| (*uri).to_owned())
        .ok_or(KeyFlaw::Prefix { prefix })
}

fn step_text(step: &Step) -> String {
    let of_uri = |uri: &String| PREFIXES.iter().find(|(_, known)| known == uri);
    let prefix = step.namespace.as_ref().and_then(of_uri);
    let prefix = prefix.map_or_else(String::new, |(prefix, _)| format!("{prefix}:"));
    let Some(name) = &step.name else {
        return format!("/{prefix}*");
    };
    let mut text = format!("/{prefix}");
    for letter in name.chars() {
        if matches!(letter, '/' | ':' | '&') || (name == "*") {
            text.push('&');
        }
        text.push(letter);
    }
    text
}

#[cfg(test)]
mod tests;
