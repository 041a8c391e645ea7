//! Where in a YAML text each key stands.

use granit_parser::{Event, Parser, ScalarStyle, Span};

/// Most nodes that are remembered, as many as the library reads; what comes later has the place of what is around it.
const MOST_NODES: usize = 250_000;
/// Deepest path that is shown.
const DEEPEST: usize = 64;

/// A place in a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
}

/// What a node hangs on.
#[derive(Clone, Debug, PartialEq)]
enum Segment {
    Root,
    Key(String),
    Index(usize),
}

/// What a node is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    Scalar { text: String, is_quoted: bool },
    List,
    Map,
}

/// A node of the text.
#[derive(Clone, Debug)]
pub(super) struct Node {
    parent: Option<usize>,
    segment: Segment,
    /// Where its key stands, or itself in a list.
    key: Place,
    /// Where its value stands.
    value: Place,
    pub kind: Kind,
    n_children: usize,
}

/// Every key of a text with its place.
#[derive(Clone, Debug, Default)]
pub struct Places {
    nodes: Vec<Node>,
}

/// A container that is open while events are read.
struct Open {
    node: Option<usize>,
    is_map: bool,
    /// The key whose value comes next.
    key: Option<(String, Place)>,
}

impl Places {
    /// Reads as much of a text as is YAML.
    #[must_use]
    pub fn of(text: &str) -> Self {
        let mut places = Self::default();
        let mut open: Vec<Open> = vec![];
        let options = granit_parser::options! { emit_unresolved_aliases: true };
        let mut parser = Parser::new_from_str_with_options(text, options);
        while let Some(Ok((event, span))) = parser.next_event() {
            match event {
                Event::Scalar(text, style, ..) => {
                    let is_quoted = style != ScalarStyle::Plain;
                    let text = text.into_owned();
                    places.scalar(&mut open, Kind::Scalar { text, is_quoted }, span);
                }
                Event::Alias(_) => places.scalar(&mut open, Kind::alias(""), span),
                Event::UnresolvedAlias(name) => {
                    places.scalar(&mut open, Kind::alias(&name), span);
                }
                Event::SequenceStart(..) => places.begin(&mut open, Kind::List, span),
                Event::MappingStart(..) => places.begin(&mut open, Kind::Map, span),
                Event::SequenceEnd | Event::MappingEnd => {
                    open.pop();
                }
                _ => {}
            }
        }
        places
    }

    fn scalar(&mut self, open: &mut [Open], kind: Kind, span: Span) {
        if let Some(map) = open.last_mut()
            && map.is_map
            && map.key.is_none()
        {
            if let Kind::Scalar { text, .. } = kind {
                map.key = Some((text, at(span)));
            }
            return;
        }
        self.add(open, kind, span);
    }

    fn begin(&mut self, open: &mut Vec<Open>, kind: Kind, span: Span) {
        let is_map = kind == Kind::Map;
        // A container as a key has no name.
        let is_key = open
            .last()
            .is_some_and(|map| map.is_map && map.key.is_none());
        let node = if is_key {
            if let Some(map) = open.last_mut() {
                map.key = Some((String::new(), at(span)));
            }
            None
        } else {
            self.add(open, kind, span)
        };
        open.push(Open {
            node,
            is_map,
            key: None,
        });
    }

    fn add(&mut self, open: &mut [Open], kind: Kind, span: Span) -> Option<usize> {
        let parent = open.last().and_then(|container| container.node);
        let value = at(span);
        let (segment, key) = match open.last_mut() {
            None => (Segment::Root, value),
            Some(map) if map.is_map => {
                let (name, place) = map.key.take().unwrap_or_else(|| (String::new(), value));
                (Segment::Key(name), place)
            }
            Some(_) => {
                let index = parent.map_or(0, |parent| self.nodes[parent].n_children);
                (Segment::Index(index), value)
            }
        };
        if self.nodes.len() >= MOST_NODES {
            return None;
        }
        if let Some(parent) = parent {
            self.nodes[parent].n_children += 1;
        }
        self.nodes.push(Node {
            parent,
            segment,
            key,
            value,
            kind,
            n_children: 0,
        });
        Some(self.nodes.len() - 1)
    }

    /// Every key with one value: its path, where the key stands, where its value stands, and the value.
    pub fn values(&self) -> impl Iterator<Item = (String, Place, Place, &str)> {
        let nodes = self.nodes.iter().enumerate();
        nodes.filter_map(|(at, node)| match (&node.segment, &node.kind) {
            (Segment::Key(_), Kind::Scalar { text, .. }) => {
                Some((self.path(at), node.key, node.value, text.as_str()))
            }
            _ => None,
        })
    }

    /// The place of a key; of what is around it where it is not there.
    #[must_use]
    pub fn find(&self, key: &str) -> Option<Place> {
        self.node(key).map(|node| self.place(node))
    }

    /// The same, where at least the first part of the path is a key of the text.
    #[must_use]
    pub fn known(&self, key: &str) -> Option<Place> {
        let node = self.node(key).filter(|node| *node > 0)?;
        Some(self.place(node))
    }

    /// The node of a path, or the last one on the way to it.
    fn node(&self, path: &str) -> Option<usize> {
        let mut node = (!self.nodes.is_empty()).then_some(0)?;
        let mut rest = path;
        while !rest.is_empty() {
            let children = self.children(node);
            // Keys may hold dots themselves: the longest that fits is meant.
            let fitting = children.filter_map(|child| {
                let segment = self.segment(child);
                let below = rest.strip_prefix(segment.as_str())?;
                let is_whole = below.is_empty() || below.starts_with(['.', '[']);
                is_whole.then_some((segment.len(), child, below))
            });
            let Some((_, child, below)) = fitting.max_by_key(|(length, ..)| *length) else {
                break;
            };
            node = child;
            rest = below.strip_prefix('.').unwrap_or(below);
        }
        Some(node)
    }

    /// The nodes right below a node.
    pub(super) fn children(&self, node: usize) -> impl Iterator<Item = usize> {
        let nodes = self.nodes.iter().enumerate().skip(node + 1);
        nodes
            .filter(move |(_, child)| child.parent == Some(node))
            .map(|(at, _)| at)
    }

    fn segment(&self, node: usize) -> String {
        match &self.nodes[node].segment {
            Segment::Root => String::new(),
            Segment::Key(name) => name.clone(),
            Segment::Index(index) => format!("[{index}]"),
        }
    }

    /// Where a reader should look: at the value of a key, or at the key of many values.
    pub(super) fn place(&self, node: usize) -> Place {
        let node = &self.nodes[node];
        match node.kind {
            Kind::Scalar { .. } if node.value.line == node.key.line => node.value,
            _ => node.key,
        }
    }

    /// Path of a node.
    pub(super) fn path(&self, node: usize) -> String {
        let mut nodes = vec![];
        let mut next = Some(node);
        while let Some(at) = next.filter(|_| nodes.len() < DEEPEST) {
            nodes.push(at);
            next = self.nodes[at].parent;
        }
        let mut path = if next.is_some() { "…" } else { "" }.to_owned();
        for at in nodes.into_iter().rev() {
            match &self.nodes[at].segment {
                Segment::Root => {}
                Segment::Key(name) => {
                    if !path.is_empty() {
                        path.push('.');
                    }
                    path.push_str(name);
                }
                Segment::Index(index) => path.push_str(&format!("[{index}]")),
            }
        }
        path
    }

    /// The node at a place: the one that begins there, or the last one that began before.
    pub(super) fn at(&self, place: Place) -> Option<usize> {
        let exact = |node: &Node| node.value == place || node.key == place;
        let found = self.nodes.iter().rposition(exact);
        found.or_else(|| self.nodes.iter().rposition(|node| node.key <= place))
    }

    /// Every node below another one, and itself.
    pub(super) fn below(&self, root: usize) -> impl Iterator<Item = (usize, &Node)> {
        let mut is_below = vec![false; self.nodes.len()];
        for at in root..self.nodes.len() {
            let hangs = self.nodes[at].parent.is_some_and(|parent| is_below[parent]);
            is_below[at] = at == root || hangs;
        }
        let nodes = self.nodes.iter().enumerate();
        nodes.filter(move |(at, _)| is_below[*at])
    }

    /// The name of a node's key.
    pub(super) fn name(&self, node: usize) -> Option<&str> {
        match &self.nodes[node].segment {
            Segment::Key(name) => Some(name),
            _ => None,
        }
    }

    pub(super) fn kind(&self, node: usize) -> &Kind {
        &self.nodes[node].kind
    }

    pub(super) fn key_place(&self, node: usize) -> Place {
        self.nodes[node].key
    }

    pub(super) fn parent(&self, node: usize) -> Option<usize> {
        self.nodes[node].parent
    }

    /// Lines of the keys of one name in the map that a node belongs to.
    pub(super) fn twins(&self, node: usize) -> Vec<usize> {
        let parent = self.nodes[node].parent;
        let name = self.name(node);
        let all = self.nodes.iter().enumerate();
        all.filter(|(at, other)| other.parent == parent && self.name(*at) == name)
            .map(|(_, other)| other.key.line)
            .collect()
    }

    /// The text again, in one line, with no other children of `node` than those of `kept`; `None` where an alias or a second
    /// document stands in it.
    pub(super) fn with_only(&self, node: usize, kept: &[usize]) -> Option<String> {
        let mut text = String::new();
        let mut open: Vec<(usize, &str)> = vec![];
        let mut is_out = vec![false; self.nodes.len()];
        for (at, one) in self.nodes.iter().enumerate() {
            let parent = one.parent;
            if at > 0 && parent.is_none() || one.kind.is_alias() {
                return None;
            }
            let is_cut = parent == Some(node) && !kept.contains(&at);
            is_out[at] = is_cut || parent.is_some_and(|parent| is_out[parent]);
            if is_out[at] {
                continue;
            }
            while let Some((_, end)) = open.pop_if(|(container, _)| Some(*container) != parent) {
                text.push_str(end);
            }
            if at > 0 && !text.ends_with(['[', '{']) {
                text.push_str(", ");
            }
            if let Segment::Key(name) = &one.segment {
                text.push_str(&format!("{}: ", quoted(name)));
            }
            match &one.kind {
                Kind::Scalar {
                    text: value,
                    is_quoted,
                } => {
                    text.push_str(&scalar(value, *is_quoted));
                }
                Kind::List => {
                    text.push('[');
                    open.push((at, "]"));
                }
                Kind::Map => {
                    text.push('{');
                    open.push((at, "}"));
                }
            }
        }
        text.extend(open.iter().rev().map(|(_, end)| *end));
        Some(text)
    }

    /// The first alias that no anchor above it has, and its name.
    pub(super) fn undefined(&self) -> Option<(usize, &str)> {
        let mut aliases = self.nodes.iter().enumerate();
        aliases.find_map(|(at, node)| {
            let name = node.kind.unresolved().filter(|name| !name.is_empty())?;
            Some((at, name))
        })
    }

    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Number of values, where a list stands at a node.
    pub(super) fn list_length(&self, node: usize) -> Option<usize> {
        let node = &self.nodes[node];
        matches!(node.kind, Kind::List).then_some(node.n_children)
    }

    /// What stands at a node.
    pub(super) fn value(&self, node: usize) -> String {
        let node = &self.nodes[node];
        match &node.kind {
            Kind::Scalar { text, is_quoted } if *is_quoted => {
                format!("\"{}\"", super::shown(text))
            }
            Kind::Scalar { text, .. } if text.is_empty() || text == "~" => "nothing".to_owned(),
            Kind::Scalar { text, .. } => super::shown(text),
            Kind::List => format!("a list of {}", node.n_children),
            Kind::Map => format!("{} keys", node.n_children),
        }
    }
}

impl Kind {
    /// An alias; with a name where no anchor above has it.
    fn alias(name: &str) -> Self {
        Self::Scalar {
            text: format!("*{name}"),
            is_quoted: false,
        }
    }

    fn is_alias(&self) -> bool {
        self.unresolved().is_some()
    }

    /// Name of an alias; empty where an anchor has it.
    fn unresolved(&self) -> Option<&str> {
        match self {
            Self::Scalar {
                text,
                is_quoted: false,
            } => text.strip_prefix('*'),
            _ => None,
        }
    }
}

/// A scalar as it stands between commas.
fn scalar(text: &str, is_quoted: bool) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || "+-._~/ ".contains(letter);
    if !is_quoted && text.is_empty() {
        "~".to_owned()
    } else if !is_quoted && text.chars().all(is_plain) {
        text.to_owned()
    } else {
        quoted(text)
    }
}

fn quoted(text: &str) -> String {
    let mut quoted = "\"".to_owned();
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            _ if letter.is_control() => {
                quoted.push_str(&format!("\\U{:08X}", u32::from(letter)));
            }
            _ => quoted.push(letter),
        }
    }
    quoted.push('"');
    quoted
}

fn at(span: Span) -> Place {
    Place {
        line: span.start.line(),
        column: span.start.col() + 1,
    }
}
