"""The verifier: decides from a segment and its context whether a gesture was meant.

Its inputs are the states and answers of both networks, and the context of the segment. It learns from people from whom
the networks have not learned. It learns about context only from sessions in which gestures and everyday life are mixed:
a take of one performance is given the past of some segment of such a session, so that its own past teaches nothing.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gestured.lab.decide import Answers, decided
from gestured.lab.fit import asked
from gestured.lab.nets import Decision, Opinion, Verifier
from gestured.lab.samples import EVERYDAY, LIKE_A_TAP, PART, Samples
from gestured.model.context import PAST
from gestured.simulator import NONE

EPOCHS = 30
BATCH = 256
RATE, DECAY = 2e-3, 3e-2
EVERYDAY_COST = 1.0  # weight of all that nobody meant in everyday life, beside 1 for all gestures
OTHERS_COST = 0.5  # weight of all non-gestures that were performed one by one


@dataclass(frozen=True, slots=True)
class Evidence:
    """The outputs of a network and of the trajectory net for G samples, with their context."""

    first: Tensor  # (G, K) logits of the network
    second: Tensor  # (G, K) of the trajectory net
    embedding: Tensor  # (G, E), as the exported model gives it
    context: Tensor  # (G, C)

    @classmethod
    def of(cls, nets: nn.ModuleDict, name: str, samples: Samples) -> "Evidence":
        """The evidence of both networks on samples."""
        net, trajectory = nets[name], nets["trajectory"]
        assert isinstance(net, Opinion)
        assert isinstance(trajectory, Opinion)
        nets.eval()

        def ask(x: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor, Tensor]:
            state, hidden = net.embed(x, lengths), trajectory.embed(x, lengths)
            return net.judge(state), trajectory.judge(hidden), torch.cat([state, hidden], 1)

        first, second, embedding = asked(samples, ask)
        return cls(first, second, embedding, torch.from_numpy(samples.context))

    def beside(self, context: NDArray[np.float32]) -> "Evidence":
        """The same evidence with another context (G, C)."""
        return replace(self, context=torch.from_numpy(context))

    @classmethod
    def join(cls, parts: "Sequence[Evidence]") -> "Evidence":
        """The evidence on several sets, one after the other."""
        return cls(*(torch.cat([getattr(part, name) for part in parts]) for name in cls.__slots__))

    def take(self, chosen: Tensor) -> "Evidence":
        """The evidence on the chosen segments, a mask or indices."""
        return Evidence(*(getattr(self, name)[chosen] for name in self.__slots__))

    def answers(self, decision: Decision, verifier: Verifier | None) -> Answers:
        """The joint answers of both networks, after the verifier if there is one."""
        if verifier is None:
            return decided(decision, self.first, self.second)
        with torch.no_grad():
            scores, cues = decision.cues(self.first, self.second)
            unknown = torch.sigmoid(verifier(cues, self.embedding, self.context))
        return scores.exp().numpy(), unknown.numpy()


def taught(samples: Samples) -> NDArray[np.int64]:
    """(G,) 0 for a gesture, 1 for everyday life, 2 for another non-gesture, -1 for what teaches nothing."""
    kinds = np.full(len(samples), 2)
    kinds[samples.kinds == EVERYDAY] = 1
    kinds[np.isin(samples.kinds, (LIKE_A_TAP, PART))] = -1
    kinds[samples.labels != NONE] = 0
    return kinds


def with_past_of(samples: Samples, lived: Samples, seed: int) -> NDArray[np.float32]:
    """(G, C) the samples' context, each with the past of some sample of everyday life, whatever that was."""
    rng = np.random.default_rng([seed, 0xFA57])
    context = samples.context.copy()
    context[:, :PAST] = lived.context[rng.integers(len(lived), size=len(samples)), :PAST]
    return context


def fit_verifier(
    decision: Decision,
    parts: Sequence[tuple[Evidence, NDArray[np.int64]]],
    seed: int,
    old: Verifier | None = None,
) -> Verifier:
    """Fit a verifier to parts of (evidence, class of each segment as `taught` gives it).

    Each of the three classes has its weight as a whole, however many segments it has. The first weights are those of
    the `old` verifier, if there is one.
    """
    y = torch.from_numpy(np.concatenate([kind for _, kind in parts]))
    with torch.no_grad():
        cues = torch.cat([decision.cues(one.first, one.second)[1] for one, _ in parts])
    embedding, context = (torch.cat([getattr(one, name) for one, _ in parts]) for name in ("embedding", "context"))
    usable = torch.nonzero(y >= 0)[:, 0]
    counts = torch.bincount(y[usable], minlength=3).clamp(min=1)
    weight = torch.tensor([1.0, EVERYDAY_COST, OTHERS_COST]) / counts * len(usable)
    torch.manual_seed(seed)
    verifier = copy.deepcopy(old)
    if verifier is None:
        verifier = Verifier(cues.shape[1], embedding.shape[1], context.shape[1])
        verifier.fit_scale(torch.cat([cues, embedding, context], 1)[usable])
    optimiser = torch.optim.AdamW(verifier.parameters(), lr=RATE, weight_decay=DECAY)
    steps = EPOCHS * -(-len(usable) // BATCH)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps, pct_start=0.1)
    verifier.train()
    for _ in range(EPOCHS):
        order = usable[torch.randperm(len(usable))]
        for start in range(0, len(order), BATCH):
            some = order[start : start + BATCH]
            raw = verifier(cues[some], embedding[some], context[some])
            losses = nn.functional.binary_cross_entropy_with_logits(raw, (y[some] > 0).float(), reduction="none")
            loss = (losses * weight[y[some]]).mean()
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            schedule.step()
    return verifier.eval()
