//! The page at work: parameters and files, the server, and what it is fed with.

use std::collections::BTreeMap;
use std::net::SocketAddr;

use anyhow::Result;
use live_view::io::{Account, IS_BUILT, LiveViewIo, Source};
use live_view::{LiveViewConfig, LiveViewError, LiveViewStage, Settings, checked_token};
use metrology::Axis;
use node_runtime::{HostTime, Setup};

use crate::feed::Feed;
use crate::limits;

/// What the files hold that the parameters name.
#[derive(Clone, Default)]
pub struct Given {
    /// The token's file and its text.
    pub token: Option<(String, String)>,
    /// Greatest offset of each axis, µm, where it is known.
    pub limits_um: BTreeMap<Axis, f64>,
    /// The clock by which it is judged what is stale.
    pub time: HostTime,
}

impl Given {
    /// Reads the files of a node.
    ///
    /// # Errors
    /// When one cannot be read, or has no limit in it.
    pub(crate) fn of(setup: &Setup, config: &LiveViewConfig) -> Result<Self> {
        let mut given = Self {
            time: setup.host_time(),
            ..Self::default()
        };
        if !config.token_file.is_empty() {
            let (path, text) = setup.file_text("token_file")?;
            given.token = Some((path.display().to_string(), text));
        }
        if !config.compensation_file.is_empty() {
            given.limits_um = limits::limits_in(&setup.file_path("compensation_file")?)?;
        }
        Ok(given)
    }
}

/// A page that is served until this is dropped.
pub struct View {
    io: LiveViewIo,
    feed: Feed,
    has_token: bool,
}

impl View {
    /// Serves it.
    ///
    /// # Errors
    /// When a parameter or the token is wrong, the address is taken, or the program was built without the server.
    pub fn open(config: &LiveViewConfig, given: Given) -> Result<Self> {
        if !IS_BUILT {
            return Err(LiveViewError::NotBuilt.into());
        }
        let settings = Settings::new(config)?;
        let token = given.token.as_ref();
        let token = token
            .map(|(file, text)| checked_token(file, text))
            .transpose()?;
        let has_token = token.is_some();
        let stage = LiveViewStage::new(settings.stale_after, given.limits_um);
        let feed = Feed::default();
        let (fed, time) = (feed.clone(), given.time);
        let source: Source = Box::new(move |out| {
            let now = time.now();
            fed.hand_over(now, out);
            now
        });
        let io = LiveViewIo::start(&settings, token, stage, source)?;
        Ok(Self {
            io,
            feed,
            has_token,
        })
    }

    /// Takes messages; every copy is of one feed.
    #[must_use]
    pub fn feed(&self) -> Feed {
        self.feed.clone()
    }

    /// Where it is.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.io.address()
    }

    /// Where it is, for a person.
    #[must_use]
    pub fn sentence(&self) -> String {
        let token = if self.has_token { "?token=TOKEN" } else { "" };
        format!("live view: http://{}/{token}", self.address())
    }

    /// What it has done so far.
    #[must_use]
    pub fn account(&self) -> Account {
        self.io.account()
    }
}
