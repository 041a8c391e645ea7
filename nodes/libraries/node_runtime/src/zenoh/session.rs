//! The one session of a process.

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use ::zenoh::pubsub::Subscriber;
use ::zenoh::sample::SampleKind;
use ::zenoh::{Session, Wait as _};
use anyhow::anyhow;

use super::graph::Graph;
use super::{settings, token};
use crate::environment::{DiscoveryRange, Environment, ZenohSettings};

/// Between looks for a router.
const ROUTER_PERIOD: Duration = Duration::from_secs(1);

type Known = Vec<(Environment, Weak<Shared>)>;

/// Sessions that are open; one but in tests, where one process stands for many.
static OPEN: Mutex<Known> = Mutex::new(Vec::new());

/// A session and what its nodes share.
pub(super) struct Shared {
    pub graph: Arc<Graph>,
    pub next_node: AtomicU64,
    pub domain: u16,
    /// Keeps the graph up to date.
    _tokens: Subscriber<()>,
    pub session: Session,
}

impl Shared {
    /// The session for what the environment says, opened by the first node that asks. A warning comes
    /// with it where no router was found.
    pub fn of(environment: &Environment) -> anyhow::Result<(Arc<Self>, Option<String>)> {
        let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        open.retain(|(_, shared)| shared.strong_count() > 0);
        let known = open.iter().find(|(known, _)| known == environment);
        if let Some(shared) = known.and_then(|(_, shared)| shared.upgrade()) {
            return Ok((shared, None));
        }
        if environment.range == DiscoveryRange::Localhost {
            tracing::info!(
                "that only this computer is meant (ROS_LOCALHOST_ONLY, ROS_AUTOMATIC_DISCOVERY_RANGE) is said to DDS alone: \
                 Zenoh reaches as far as its router listens and connects"
            );
        }
        let shared = Arc::new(Self::open(environment)?);
        open.push((environment.clone(), Arc::downgrade(&shared)));
        drop(open);
        let warning = shared.look_for_router(&environment.zenoh);
        Ok((shared, warning))
    }

    fn open(environment: &Environment) -> anyhow::Result<Self> {
        let config = settings::config(&environment.zenoh)?;
        let opened = ::zenoh::open(config).wait();
        let session = opened.map_err(|error| anyhow!("Zenoh session: {error}"))?;
        let graph = Arc::<Graph>::default();
        let seen = Arc::clone(&graph);
        let tokens = session
            .liveliness()
            .declare_subscriber(token::all_of(environment.domain_id))
            .history(true)
            .callback(move |sample| match sample.kind() {
                SampleKind::Put => seen.appeared(sample.key_expr().as_str()),
                SampleKind::Delete => seen.vanished(sample.key_expr().as_str()),
            })
            .wait()
            .map_err(|error| anyhow!("Zenoh's liveliness: {error}"))?;
        Ok(Self {
            graph,
            next_node: AtomicU64::new(0),
            domain: environment.domain_id,
            _tokens: tokens,
            session,
        })
    }

    /// Waits for a router as long as the settings say, and complains where there is none.
    #[expect(
        clippy::disallowed_methods,
        reason = "no node runs yet: the program waits for its network"
    )]
    fn look_for_router(&self, settings: &ZenohSettings) -> Option<String> {
        let most = match settings.router_checks {
            ..=-1 => return None,
            0 => i64::MAX,
            looks => looks,
        };
        for look in 1..=most {
            if self.session.info().routers_zid().wait().next().is_some() {
                return None;
            }
            if look < most {
                std::thread::sleep(ROUTER_PERIOD);
            }
        }
        Some(format!(
            "no Zenoh router found ({most} looks, ZENOH_ROUTER_CHECK_ATTEMPTS): nodes of other programs are met \
             when there is one (`ros2 run rmw_zenoh_cpp rmw_zenohd`, `zenohd`)"
        ))
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // What cannot be closed is gone with the process.
        let _ = self.session.close().wait();
    }
}
