//! In which order products are made: what is made of a product in, what can be made next out.

use std::collections::{BTreeMap, BTreeSet};

use contract::product::ProductId;

use super::recipe::Recipe;

/// What is still to be made, each after what it is made of.
pub(super) struct Order {
    recipes: BTreeMap<ProductId, Recipe>,
    /// Of each what is to be made before it.
    waiting: BTreeMap<ProductId, BTreeSet<ProductId>>,
}

impl Order {
    /// Everything that is made of a product, directly or through others.
    pub(super) fn of(product: &ProductId, recipes: BTreeMap<ProductId, Recipe>) -> Self {
        let mut found = BTreeSet::new();
        let mut open = vec![product.clone()];
        while let Some(source) = open.pop() {
            for (target, recipe) in &recipes {
                let reads = recipe.sources().any(|it| *it == source);
                if reads && target != product && found.insert(target.clone()) {
                    open.push(target.clone());
                }
            }
        }
        let mut waiting = BTreeMap::new();
        for (target, recipe) in recipes.iter().filter(|(target, _)| found.contains(*target)) {
            let before = recipe.sources().filter(|it| found.contains(*it)).cloned();
            waiting.insert(target.clone(), before.collect());
        }
        Self { recipes, waiting }
    }

    /// What can be made next, and what reads the same; none where nothing can be.
    pub(super) fn next(&mut self) -> Option<BTreeMap<ProductId, Recipe>> {
        let ready = self.waiting.iter().filter(|(_, before)| before.is_empty());
        let ready = ready.filter_map(|(target, _)| self.recipes.get_key_value(target));
        let (first, recipe) = ready
            .clone()
            .min_by_key(|(target, it)| (it.rank(), *target))?;
        let next = ready.filter(|(target, it)| *target == first || it.goes_with(recipe));
        let next: BTreeMap<_, _> = next
            .map(|(target, it)| (target.clone(), it.clone()))
            .collect();
        self.waiting.retain(|target, _| !next.contains_key(target));
        Some(next)
    }

    /// What was next was made, or cannot be.
    pub(super) fn done<'a>(&mut self, targets: impl Iterator<Item = &'a ProductId>) {
        for target in targets {
            for before in self.waiting.values_mut() {
                before.remove(target);
            }
        }
    }

    /// What can never be made, for it is made of itself.
    pub(super) fn left(self) -> impl Iterator<Item = ProductId> {
        self.waiting.into_keys()
    }
}

#[cfg(test)]
mod tests {
    use contract::computed::{Computation, Matching};

    use super::*;
    use crate::computed::{Request, RequestedInput};

    fn id(name: &str) -> ProductId {
        name.parse().unwrap()
    }

    fn computed((target, sources): (&str, &[&str])) -> (ProductId, Recipe) {
        let input = |name: &&str| RequestedInput {
            name: (*name).to_owned(),
            product: id(name),
            matching: Matching::SamePeriod,
        };
        let request = Request {
            target: id(target),
            title: None,
            quantity: None,
            how: Computation::Expression {
                expression: String::new(),
            },
            grid: None,
            inputs: sources.iter().map(input).collect(),
            from: None,
            to: None,
        };
        (id(target), Recipe::Computed(Box::new(request)))
    }

    /// What is made of `source`, in its order, and what is left.
    fn made(of: &[(&str, &[&str])]) -> (Vec<String>, Vec<String>) {
        let recipes = of.iter().map(|one| computed(*one));
        let mut recipes: BTreeMap<_, _> = recipes.collect();
        let flux = Recipe::Accumulated(id("z-flux"));
        recipes.insert(id("z-flux-accumulated"), flux);
        let mut order = Order::of(&id("source"), recipes);
        let mut made = vec![];
        while let Some(next) = order.next() {
            order.done(next.keys());
            made.extend(next.into_keys().map(|it| it.to_string()));
        }
        (made, order.left().map(|it| it.to_string()).collect())
    }

    #[test]
    fn each_is_made_once_and_after_all_that_it_is_made_of() {
        let (order, left) = made(&[
            ("a-of-both", &["source", "b"]),
            ("b", &["z-flux", "source"]),
            ("z-flux", &["source"]),
            ("c", &["other"]),
            ("d", &["source", "other"]),
        ]);
        let expected = ["d", "z-flux", "z-flux-accumulated", "b", "a-of-both"];
        assert_eq!(order, expected);
        assert!(left.is_empty());
    }

    #[test]
    fn what_is_made_of_itself_is_left_and_the_rest_made() {
        let (order, left) = made(&[
            ("a", &["source", "b"]),
            ("b", &["a"]),
            ("c", &["source"]),
            // The product itself is not made: it has a newer version already.
            ("source", &["c"]),
        ]);
        assert_eq!(order, ["c"]);
        assert_eq!(left, ["a", "b"]);
    }
}
