//! Answers pause, resume and step, and says on `/diagnostics` how far the bag is.

use std::convert::Infallible;

use abbe_msgs::std_srvs::srv::TriggerResponse;
use metrology::{Host, Stage, Stamp};
use node_runtime::{Diagnostic, Level};
use replayer::pause::Pause;

use crate::player::Player;

pub(crate) enum Input {
    Tick,
    Pause,
    Resume,
    Step,
    Shutdown,
}

pub(crate) enum Output {
    Answer(TriggerResponse),
    Condition(Diagnostic),
    Stopped,
}

impl Output {
    pub fn answer(&self) -> Option<TriggerResponse> {
        match self {
            Self::Answer(answer) => Some(answer.clone()),
            Self::Condition(_) | Self::Stopped => None,
        }
    }

    pub fn diagnostic(&self) -> Option<Diagnostic> {
        match self {
            Self::Condition(diagnostic) => Some(diagnostic.clone()),
            Self::Answer(_) | Self::Stopped => None,
        }
    }
}

pub(crate) struct Watch {
    player: Option<Player>,
    over: bool,
    /// Number of pauses reported so far.
    pauses: usize,
    is_pausing: bool,
}

impl Watch {
    pub fn new(player: Player) -> Self {
        Self {
            player: Some(player),
            over: false,
            pauses: 0,
            is_pausing: false,
        }
    }

    fn look(&mut self, out: &mut Vec<Output>) {
        let Some(progress) = self.player.as_ref().map(|player| player.desk().progress()) else {
            return;
        };
        if let Some((begun, pause)) = progress.pause
            && begun > self.pauses
        {
            self.pauses = begun;
            self.is_pausing = true;
            let diagnostic = Diagnostic::new(Level::Warn, "pause", pause.to_string());
            let wait_s = pause.wait_s();
            out.push(Output::Condition(diagnostic.with("wait_s", wait_s)));
        }
        let is_behind = |pause: &Pause| progress.at >= pause.to;
        if self.is_pausing && progress.pause.is_none_or(|(_, pause)| is_behind(&pause)) {
            self.is_pausing = false;
            let diagnostic = Diagnostic::new(Level::Ok, "pause", "it is over".to_owned());
            out.push(Output::Condition(diagnostic));
        }
        let Some(outcome) = progress.over.filter(|_| !self.over) else {
            return;
        };
        self.over = true;
        match outcome {
            Ok(played) => {
                for loss in &played.losses {
                    out.push(failure(loss));
                }
                if played.lost > 0 {
                    let all = played.losses.join("; ");
                    let lost = played.lost;
                    out.push(failure(&format!("{lost} messages were lost: {all}")));
                }
                let message = format!("the bag is played to its end: {} messages", played.messages);
                let diagnostic = Diagnostic::new(Level::Ok, "played", message);
                out.push(Output::Condition(diagnostic));
            }
            Err(reason) => out.push(failure(&reason)),
        }
    }

    /// `done` says whether it was done, and the answer what there is now.
    fn steer(&self, done: impl Fn(&Player) -> bool, refusal: &str) -> Output {
        let Some(player) = &self.player else {
            return answer(false, "the player has ended".to_owned());
        };
        if !done(player) {
            return answer(false, refusal.to_owned());
        }
        let progress = player.desk().progress();
        let state = if progress.paused { "paused" } else { "playing" };
        let at_s = progress.at.as_secs_f64();
        answer(
            true,
            format!("{state} at {at_s:.6} s, {} messages sent", progress.sent),
        )
    }

    /// Leaving the network waits, which the runtime's own threads must not: a thread for it.
    fn close(&mut self, out: &mut Vec<Output>) {
        let Some(player) = self.player.take() else {
            return;
        };
        match std::thread::spawn(move || player.finish()).join() {
            Ok(Ok(())) => {}
            Ok(Err(error)) => out.push(failure(&format!("{error:#}"))),
            Err(_) => out.push(failure("the player's thread panicked")),
        }
    }
}

fn answer(success: bool, message: String) -> Output {
    Output::Answer(TriggerResponse { success, message })
}

fn failure(reason: &str) -> Output {
    Output::Condition(Diagnostic::new(Level::Error, "playing", reason.to_owned()))
}

impl Stage for Watch {
    type Input = Input;
    type Output = Output;
    type Error = Infallible;

    fn step(
        &mut self,
        _at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        match input {
            Input::Tick => self.look(out),
            Input::Pause => out.push(self.steer(|p| p.desk().pause(), "it is paused already")),
            Input::Resume => out.push(self.steer(|p| p.desk().resume(), "it is not paused")),
            Input::Step => out.push(self.steer(
                |p| p.desk().step(),
                "it is not paused: pause it before a step",
            )),
            Input::Shutdown => {
                self.close(out);
                out.push(Output::Stopped);
            }
        }
        Ok(())
    }
}
