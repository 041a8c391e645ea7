"""The diagnosis' search for the best set of effects with numpy: the same Gram matrix in, the same set out.

Standard input: the problem as JSON (nodes/gap_diagnosis/src/search/problem.rs). Standard output: the set, its C, and the seconds of each of `repeats` searches.
"""

import json
import sys
import time

import numpy as np

PIVOT = 1e-7
EPSILON = 1e-9


class Search:
    def __init__(self, problem):
        self.gram = np.array(problem["gram"])
        self.along = np.array(problem["along"])
        self.forms = problem["forms"]
        self.square = problem["square"]
        self.log_rows = problem["log_rows"]
        self.log_instances = problem["log_instances"]
        self.beam = problem["beam"]
        self.most = problem["most_effects"]
        self.most_forms = problem["most_forms"]
        self.most_free = problem["most_free"]
        self.most_cancelling = problem["most_cancelling"]
        self.instance = np.array([form["instance"] for form in self.forms])
        self.prices = np.array([form["price"] for form in self.forms], dtype=float)
        self.by_width = {}
        for place, form in enumerate(self.forms):
            self.by_width.setdefault(len(form["columns"]), []).append(place)
        self.by_width = {
            width: (np.array(places), np.array([self.forms[p]["columns"] for p in places]))
            for width, places in self.by_width.items()
        }
        self.visited = {(): self.square}

    def columns(self, chosen):
        return [column for form in chosen for column in self.forms[form]["columns"]]

    def independent(self, columns):
        """Columns that the ones before them do not span."""
        kept = []
        for column in columns:
            if kept:
                part = self.gram[np.ix_(kept, kept)]
                cross = self.gram[kept, column]
                pivot = self.gram[column, column] - cross @ np.linalg.solve(part, cross)
            else:
                pivot = self.gram[column, column]
            if pivot > PIVOT * self.gram[column, column] and pivot > 0.0:
                kept.append(column)
        return kept

    def score(self, chosen):
        if chosen in self.visited:
            return self.visited[chosen]
        columns = self.columns(chosen)
        kept = self.independent(columns)
        sizes = np.zeros(len(columns))
        solution = np.linalg.solve(self.gram[np.ix_(kept, kept)], self.along[kept])
        for column, size in zip(kept, solution):
            sizes[columns.index(column)] = size
        limits = np.array([limit for form in chosen for limit in self.forms[form]["sizes"]])
        gain = self.along[kept] @ solution
        is_physical = np.all((sizes >= limits[:, 0]) & (sizes <= limits[:, 1]))
        if is_physical and self.are_sound(chosen, sizes, gain):
            price = self.prices[list(chosen)].sum() * self.log_rows
            score = self.square - gain + price + 2.0 * len(chosen) * self.log_instances
        else:
            score = np.inf
        self.visited[chosen] = score
        return score

    def are_sound(self, chosen, sizes, gain):
        """Whether no wide form is mostly what widens it, and no member cancels another."""
        first = 0
        for place in chosen:
            form = self.forms[place]
            columns = form["columns"]
            own = sizes[first : first + len(columns)]
            first += len(columns)
            gram = self.gram[np.ix_(columns, columns)]
            widens = np.array(form["widens"])
            if widens.any():
                free, rest = np.where(widens, own, 0.0), np.where(widens, 0.0, own)
                if free @ gram @ free > self.most_free**2 * (rest @ gram @ rest):
                    return False
            if len(chosen) > 1 and own @ gram @ own > self.most_cancelling * gain:
                return False
        return True

    def gains_beside(self, chosen):
        """What each form takes beside a set, all forms of one width at once."""
        kept = self.independent(self.columns(chosen))
        if kept:
            half = np.linalg.solve(self.gram[np.ix_(kept, kept)], self.gram[kept])
            gram = self.gram - self.gram[:, kept] @ half
            along = self.along - half.T @ self.along[kept]
        else:
            gram, along = self.gram, self.along
        gains = np.zeros(len(self.forms))
        for width, (places, columns) in self.by_width.items():
            own = self.gram[columns, columns]
            alive = gram[columns, columns] > PIVOT * own
            small = gram[columns[:, :, None], columns[:, None, :]]
            right = np.where(alive, along[columns], 0.0)
            mask = alive[:, :, None] & alive[:, None, :]
            small = np.where(mask, small, np.eye(width))
            try:
                gains[places] = (right * np.linalg.solve(small, right[:, :, None])[:, :, 0]).sum(axis=1)
            except np.linalg.LinAlgError:
                pseudo = np.linalg.pinv(small, rcond=PIVOT, hermitian=True)
                gains[places] = (right * (pseudo @ right[:, :, None])[:, :, 0]).sum(axis=1)
        return gains

    def beside(self, chosen, most):
        taken = {self.instance[form] for form in chosen}
        worth = self.gains_beside(chosen) - self.prices * self.log_rows
        open_forms = {}
        for form in np.argsort(-worth, kind="stable"):
            instance = self.instance[form]
            if instance not in taken:
                open_forms.setdefault(instance, []).append(int(form))
        sets = [self.best_sound(chosen, forms) for forms in list(open_forms.values())[:most]]
        return sorted(sets, key=lambda pair: pair[0])

    def best_sound(self, chosen, forms):
        """The first form of an instance, the best first, that may stand beside a set."""
        tried = []
        for form in forms[: self.most_forms]:
            one = tuple(sorted((*chosen, form)))
            tried.append((self.score(one), one))
            if np.isfinite(tried[-1][0]):
                return tried[-1]
        return tried[0]

    def polished(self, chosen):
        while True:
            best = (self.score(chosen) - EPSILON, chosen)
            for form in chosen:
                less = tuple(other for other in chosen if other != form)
                score = self.score(less)
                if score < best[0]:
                    best = (score, less)
                swapped = self.beside(less, 4)
                if swapped and swapped[0][0] < best[0]:
                    best = swapped[0]
            if best[1] == chosen:
                return chosen
            chosen = best[1]

    def run(self):
        beam, best = [()], ()
        for _ in range(self.most):
            following = {}
            for chosen in beam:
                for score, one in self.beside(chosen, 2 * self.beam):
                    following[one] = score
            ranked = sorted(following, key=following.get)[: self.beam]
            beam = sorted({self.polished(s) if rank < 2 else s for rank, s in enumerate(ranked)}, key=lambda s: self.visited[s])
            if not beam or self.visited[beam[0]] >= self.visited[best] - EPSILON:
                break
            best = beam[0]
        return best


def main():
    problem = json.load(sys.stdin)
    seconds = []
    for _ in range(problem["repeats"]):
        search = Search(problem)
        began = time.perf_counter()
        best = search.run()
        seconds.append(time.perf_counter() - began)
    json.dump({"set": list(best), "score": search.visited[best], "seconds": seconds}, sys.stdout)


main()
