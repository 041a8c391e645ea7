//! Carrying out what the node says.

use uuid::Uuid;

use super::{ClientUse, Owner, now};
use crate::clock;
use crate::diagnostic::{Diagnostic, Level};
use crate::live::requests::Due;
use crate::node::{Bytes, Emission, GoalId, GoalStatus, RequestId};

impl Owner {
    pub(super) fn carry(&mut self, emission: Emission) {
        match emission {
            Emission::Publish { publication, bytes } => self.publish(publication, &bytes),
            Emission::Respond { service, id, bytes } => {
                if let Some((place, to)) = self.requests.remove(&(service, id)) {
                    self.answer(place, to, &bytes);
                }
            }
            Emission::Call { client, id, bytes } => self.call(client, id, bytes),
            Emission::AcceptGoal { server, id } => self.decide(server, id, true),
            Emission::RejectGoal { server, id } => self.decide(server, id, false),
            Emission::Feedback { server, id, bytes } => self.feedback(server, id, &bytes),
            Emission::FinishGoal {
                server,
                id,
                status,
                bytes,
            } => {
                self.finish_goal(server, id, status, &bytes);
            }
            Emission::SendGoal { client, id, bytes } => {
                let goal = *Uuid::new_v4().as_bytes();
                let ask = self.used_actions[client].client.send(id, goal, &bytes);
                self.ask(client, ask, Due::AtOnce);
            }
            Emission::CancelGoal { client, id } => {
                if let Some(ask) = self.used_actions[client].client.cancel(id) {
                    self.ask(client, ask, Due::AtOnce);
                }
            }
            Emission::Diagnostic(diagnostic) => self.board.report(diagnostic, now()),
            Emission::Stopped => self.stopped = true,
        }
    }

    fn publish(&mut self, place: usize, bytes: &Bytes) {
        let publication = &mut self.publications[place];
        match publication.writer.publish(bytes, self.clock.source()) {
            Ok(()) => publication.sent += 1,
            Err(error) => {
                publication.unsent += 1;
                let topic = publication.topic.clone();
                self.unsent(&topic, &error);
            }
        }
    }

    fn call(&mut self, client: usize, id: RequestId, bytes: Bytes) {
        let is_wanted =
            |used: &ClientUse| matches!(used, ClientUse::Service(place) if *place == client);
        if let Some((_, end)) = self.clients.iter_mut().find(|(used, _)| is_wanted(used)) {
            end.requests.ask(id, bytes, Due::AtOnce, now());
        }
    }

    fn decide(&mut self, action: usize, id: GoalId, accepted: bool) {
        let at = clock::ros_time(self.clock.now());
        if let Some(answer) = self.actions[action].server.decide(id, accepted, at) {
            self.answer_goal(action, &answer);
            self.publish_status(action);
        }
    }

    fn feedback(&mut self, action: usize, id: GoalId, bytes: &Bytes) {
        let end = &self.actions[action];
        let Some(bytes) = end.server.feedback(id, bytes) else {
            return;
        };
        if let Err(error) = end.feedback.publish(&bytes, None) {
            let name = end.name.clone();
            self.unsent(&name, &error);
        }
    }

    fn finish_goal(&mut self, action: usize, id: GoalId, status: GoalStatus, bytes: &Bytes) {
        if bytes.get(4) != Some(&(status as u8)) {
            let name = self.actions[action].name.clone();
            let message = format!("{name}: the result of goal {id} does not begin with its status");
            let diagnostic = Diagnostic::new(Level::Error, "result_malformed", message);
            self.notice(diagnostic.with("action", name));
            return;
        }
        for answer in self.actions[action].server.finish(id, status, bytes, now()) {
            self.answer_goal(action, &answer);
        }
        self.publish_status(action);
    }
}
