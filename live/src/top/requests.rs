//! Requests of the operator to the daemon, one after the other, in a separate thread.

use std::sync::mpsc::{Receiver, Sender};
use std::time::Duration;

use trued_client::{Answer, Mode, Monitor};

/// Time limit of an answer: a reload reads and checks a model.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// Requests that an operator can make by a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OperatorRequest {
    Bypass(bool),
    Mode(Mode),
    Arm,
    Reload,
}

impl OperatorRequest {
    /// Description, as in the commands of the shell.
    pub(super) fn description(self) -> String {
        match self {
            Self::Bypass(true) => "bypass on".to_owned(),
            Self::Bypass(false) => "bypass off".to_owned(),
            Self::Mode(mode) => format!("mode {}", mode.name()),
            Self::Arm => "arm".to_owned(),
            Self::Reload => "reload the model".to_owned(),
        }
    }

    /// Whether it can increase the correction: then it has to be confirmed. A request that removes
    /// the correction is sent at once.
    pub(super) fn needs_confirmation(self) -> bool {
        !matches!(self, Self::Bypass(true) | Self::Mode(Mode::Shadow))
    }
}

/// A request with its answer.
#[derive(Clone, Debug)]
pub(super) struct AnsweredRequest {
    pub(super) request: OperatorRequest,
    pub(super) message: String,
}

/// Answers requests until the sender is dropped.
pub(super) fn run(
    mut monitor: Monitor,
    requests: &Receiver<OperatorRequest>,
    answers: &Sender<AnsweredRequest>,
) {
    for request in requests {
        let response = match request {
            OperatorRequest::Bypass(on) => monitor.bypass(on, ANSWER_TIMEOUT),
            OperatorRequest::Mode(mode) => monitor.mode(mode, ANSWER_TIMEOUT),
            OperatorRequest::Arm => monitor.arm(true, ANSWER_TIMEOUT),
            OperatorRequest::Reload => monitor.reload(None, ANSWER_TIMEOUT),
        };
        let message = match response {
            Ok(response) => match response.answer() {
                Ok(Answer::Done) => response.message.to_string(),
                Ok(answer) => format!("{answer}: {}", response.message),
                Err(unknown) => unknown.to_string(),
            },
            Err(error) => error.to_string(),
        };
        if answers.send(AnsweredRequest { request, message }).is_err() {
            return;
        }
    }
}
