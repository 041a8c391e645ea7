//! A served page: its files, its server and its feed.

use std::collections::BTreeMap;
use std::net::SocketAddr;

use anyhow::Result;
use live_view::io::{Account, LiveViewIo, Source};
use live_view::{LiveViewConfig, LiveViewStage, Settings, checked_token};
use metrology::Axis;
use node_runtime::{HostTime, Setup};

use crate::feed::Feed;
use crate::limits;

/// Contents of the files that the parameters name, and the clock.
#[derive(Clone, Default)]
pub struct ViewOptions {
    /// File of the token and its text.
    pub token: Option<(String, String)>,
    /// Greatest offset of each axis, µm, where known.
    pub limits_um: BTreeMap<Axis, f64>,
    /// Clock for stale values.
    pub time: HostTime,
}

impl ViewOptions {
    /// Reads the files of a node.
    ///
    /// # Errors
    /// When one cannot be read, or has no limit.
    pub(crate) fn of(setup: &Setup, config: &LiveViewConfig) -> Result<Self> {
        let mut options = Self {
            time: setup.host_time(),
            ..Self::default()
        };
        if !config.token_file.is_empty() {
            let (path, text) = setup.file_text("token_file")?;
            options.token = Some((path.display().to_string(), text));
        }
        if !config.compensation_file.is_empty() {
            options.limits_um = limits::limits_in(&setup.file_path("compensation_file")?)?;
        }
        Ok(options)
    }
}

/// A page, served until dropped.
pub struct View {
    io: LiveViewIo,
    feed: Feed,
    has_token: bool,
}

impl View {
    /// Starts serving.
    ///
    /// # Errors
    /// When a parameter or the token is wrong, the address is taken, or the program was built without the server.
    pub fn open(config: &LiveViewConfig, options: ViewOptions) -> Result<Self> {
        let settings = Settings::new(config)?;
        let token = options.token.as_ref();
        let token = token
            .map(|(file, text)| checked_token(file, text))
            .transpose()?;
        let has_token = token.is_some();
        let stage = LiveViewStage::new(settings.stale_after(), options.limits_um);
        let feed = Feed::default();
        let (fed, time) = (feed.clone(), options.time);
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

    /// Feed of the page; clones share it.
    #[must_use]
    pub fn feed(&self) -> Feed {
        self.feed.clone()
    }

    /// Address of the page.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.io.address()
    }

    /// Address of the page, for a person.
    #[must_use]
    pub fn sentence(&self) -> String {
        let token = if self.has_token { "?token=TOKEN" } else { "" };
        format!("live view: http://{}/{token}", self.address())
    }

    /// Browsers and refused requests so far.
    #[must_use]
    pub fn account(&self) -> Account {
        self.io.account()
    }
}
