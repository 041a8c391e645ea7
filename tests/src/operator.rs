//! Somebody who steers a managed node of a composed run.

use std::sync::{Arc, Mutex};

use abbe_msgs::lifecycle_msgs::msg::Transition;
use abbe_msgs::lifecycle_msgs::srv::{ChangeState, ChangeStateRequest, ChangeStateResponse};
use abbe_msgs::{Service as _, from_cdr, to_cdr};
use metrology::stamp::{Host, Span, Stamp};
use node_runtime::node::{Ports, ServiceEvents, ServicePort};
use node_runtime::parameter::Parameter;
use node_runtime::{Emission, Event, Node, NodeFault};

/// Somebody who asks for steps at their times, and writes down the answers.
pub struct Operator {
    start: Stamp<Host>,
    ports: Ports,
    plan: Vec<(f64, &'static str)>,
    asked: usize,
    answers: Answers,
}

/// When an answer came, to what, and what it says.
pub type Answers = Arc<Mutex<Vec<(f64, &'static str, bool)>>>;

impl Operator {
    /// Asks `node` for each step of `plan` when so many seconds since `start` have passed, and the answers that come.
    ///
    /// # Panics
    /// In the run, when an answer cannot be read.
    #[must_use]
    pub fn of(
        start: Stamp<Host>,
        node: &str,
        plan: &[(f64, &'static str)],
    ) -> (Box<dyn Node>, Answers) {
        let answers = Answers::default();
        let client = ServicePort {
            service: format!("{node}/change_state"),
            type_name: ChangeState::TYPE_NAME,
            events: ServiceEvents::of::<ChangeState>(),
        };
        let operator = Self {
            start,
            ports: Ports {
                clients: vec![client],
                timers: vec![Span::from_nanos(7_700_000)],
                ..Ports::default()
            },
            plan: plan.to_vec(),
            asked: 0,
            answers: Arc::clone(&answers),
        };
        (Box::new(operator), answers)
    }
}

impl Node for Operator {
    fn name(&self) -> &str {
        "operator"
    }

    fn ports(&self) -> &Ports {
        &self.ports
    }

    fn parameters(&self) -> &[Parameter] {
        &[]
    }

    fn handle(
        &mut self,
        at: Stamp<Host>,
        event: Event<'_>,
        out: &mut Vec<Emission>,
    ) -> Result<(), NodeFault> {
        match event {
            Event::Timer { .. } => {
                let due = self.plan.get(self.asked);
                if let Some((_, label)) =
                    due.filter(|(when_s, _)| at - self.start >= Span::from_secs_f64(*when_s))
                {
                    let transition = Transition {
                        label: (*label).to_owned(),
                        ..Transition::default()
                    };
                    let bytes = to_cdr(&ChangeStateRequest { transition }).into();
                    let id = self.asked as u64;
                    out.push(Emission::Call {
                        client: 0,
                        id,
                        bytes,
                    });
                    self.asked += 1;
                }
            }
            Event::Response {
                id,
                bytes: Some(bytes),
                ..
            } => {
                let answer: ChangeStateResponse = from_cdr(bytes).unwrap();
                let at_s = (at - self.start).as_secs_f64();
                let (_, label) = self.plan[usize::try_from(id).unwrap()];
                let mut answers = self.answers.lock().unwrap();
                answers.push((at_s, label, answer.success));
            }
            Event::Shutdown => out.push(Emission::Stopped),
            _ => {}
        }
        Ok(())
    }
}
