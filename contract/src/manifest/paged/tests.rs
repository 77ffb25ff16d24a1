//! Manifests cut into pages and put together again, and which pages a change makes.

use super::*;
use crate::manifest::MANIFEST_SCHEMA;
use crate::manifest::page_ends::MOST_STEPS;
use crate::time::Period;

/// Of these days.
fn manifest(days: impl IntoIterator<Item = i64>) -> Manifest {
    let product: crate::product::ProductId = "p".parse().unwrap();
    let day = |day: i64| TimeMs::new(day * 86_400_000).unwrap();
    let step = |at: &i64| Step {
        period: Period::new(day(*at), day(at + 1)).unwrap(),
        field: ObjectKey::field(&product, &Digest::of(&at.to_le_bytes())),
        raw_sha256: Digest::of(b""),
        origin: format!("{at}.nc"),
        valid_cells: 7,
        masked: None,
        contributed: None,
    };
    // Files of several steps, one of them over the end of a page; some of before orders were kept.
    let order = |at: &i64| {
        let file = if (100..150).contains(at) { 100 } else { *at };
        let order = format!("2001-03-01T00:00:00Z/0/{file}/0").parse();
        (*at >= 7).then(|| order.unwrap())
    };
    let days: Vec<i64> = days.into_iter().collect();
    Manifest {
        schema: MANIFEST_SCHEMA,
        number: 12,
        title: "P".to_owned(),
        quantity: Quantity::CarbonFlux,
        synthetic: true,
        source: "s".to_owned(),
        grid: Grid {
            rows: 1,
            cols: 1,
            north_deg: 1.0,
            west_deg: 0.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        },
        steps: days.iter().map(step).collect(),
        domain: ObjectKey::domain(&product, &Digest::of(b"")),
        series: vec![],
        derived_from: Some("q@3-0a1b2c3d".parse().unwrap()),
        computed: None,
        notices: NoticeRun::of(&days.iter().map(order).collect::<Vec<_>>()),
        indexes: vec!["depth=3".parse().unwrap()],
        product,
    }
}

#[test]
fn a_manifest_of_pages_is_the_same_and_has_the_same_name() {
    let least = LEAST_PAGED_STEPS as i64;
    for days in [least, 255, 385, 2000] {
        let whole = manifest(0..days);
        let (paged, pages) = whole.paged().unwrap();
        assert!(pages.len() >= days as usize / MOST_STEPS, "{}", pages.len());
        let text = serde_json::to_string(&paged).unwrap();
        let read: PagedManifest = serde_json::from_str(&text).unwrap();
        let again = read.with_pages(&pages).unwrap();
        assert_eq!((again.id(), &again), (whole.id(), &whole));
        assert_eq!(paged.id, whole.id());
    }
    assert_eq!(manifest(0..least - 1).paged(), None);
}

#[test]
fn other_pages_than_those_that_it_names_are_refused() {
    let (paged, pages) = manifest(0..500).paged().unwrap();
    assert!(pages.len() > 2);
    let is_taken = |pages: &[Page]| paged.clone().with_pages(pages).is_ok();
    assert!(is_taken(&pages));
    assert!(!is_taken(&pages[1..]));
    assert!(!is_taken(&pages[..pages.len() - 1]));
    // A page that lacks its last step, and so ends nowhere, and one that lacks its first.
    let mut other = pages.clone();
    other[0].steps.pop();
    assert!(!is_taken(&other));
    // Two that are one.
    let mut other = pages.clone();
    let second = other.remove(1);
    other[0].steps.extend(second.steps);
    assert!(!is_taken(&other));
    // One more, that the steps do end and nothing names.
    let mut more = pages.clone();
    more.push(pages[0].clone());
    assert!(!is_taken(&more));
}

/// As programs up to schema 3 stored it.
fn in_even_pages(whole: &Manifest) -> (PagedManifest, Vec<Page>) {
    let (mut paged, _pages) = whole.paged().unwrap();
    let (steps, orders) = (&whole.steps, whole.notice_orders());
    let page = |(steps, orders): (&[Step], &[_])| Page {
        schema: 3,
        steps: steps.to_vec(),
        notices: NoticeRun::of(orders),
    };
    let even = (steps.chunks_exact(128), orders.chunks_exact(128));
    paged.schema = 3;
    paged.rest = page((even.0.remainder(), even.1.remainder()));
    let pages: Vec<Page> = even.0.zip(even.1).map(page).collect();
    paged.pages = pages.iter().map(Page::name).collect();
    (paged, pages)
}

#[test]
fn pages_of_schema_3_are_read_and_are_of_128_steps_each() {
    let whole = manifest(0..=3 * 128);
    let (paged, pages) = in_even_pages(&whole);
    assert_eq!(paged.clone().with_pages(&pages).unwrap(), whole);
    assert!(paged.clone().with_pages(&pages[1..]).is_err());
    let mut other = pages;
    other[0].steps.pop();
    assert!(paged.clone().with_pages(&other).is_err());
    // Ends of schema 4 are none of schema 3, and the other way round.
    let (now, pages_now) = whole.paged().unwrap();
    assert!(paged.with_pages(&pages_now).is_err());
    let as_3 = PagedManifest { schema: 3, ..now };
    assert!(as_3.with_pages(&pages_now).is_err());
}

/// What knows these pages under a name that no page has: it shows whose name was taken.
fn known(pages: &[Page], name: Digest) -> impl Fn(TimeMs) -> Option<(Digest, Arc<Page>)> + use<'_> {
    move |start| {
        let mut pages = pages.iter();
        let own = pages.find(|page| page.steps[0].period.start == start)?;
        Some((name, Arc::new(own.clone())))
    }
}

#[test]
fn pages_that_are_known_are_compared_and_not_named_again() {
    let (days, name) = (400, Digest::of(b"known"));
    let (paged, pages) = manifest(0..days).paged().unwrap();
    let count = pages.len();
    let before = known(&pages, name);
    let (same, new) = manifest(0..days).paged_after(&before).unwrap();
    assert_eq!((same.pages, new), (vec![name; count], vec![]));
    let mut changed = manifest(0..days);
    changed.steps[pages[0].steps.len()].valid_cells += 1;
    let (other, new) = changed.paged_after(&before).unwrap();
    let page = changed.paged().unwrap().1[1].clone();
    assert_eq!(new, [(page.name(), page)]);
    let mut expected = vec![name; count];
    expected[1] = new[0].0;
    assert_eq!(other.pages, expected);
    // Another place in the order of notices is another page.
    let mut changed = manifest(0..days);
    let mut orders = changed.notice_orders();
    orders[0] = orders[7];
    changed.notices = NoticeRun::of(&orders);
    let (other, new) = changed.paged_after(&before).unwrap();
    assert_eq!(new.len(), 1);
    let mut expected = vec![name; count];
    expected[0] = new[0].0;
    assert_eq!(other.pages, expected);
    assert_ne!(other.pages[0], paged.pages[0]);
    // The same steps in a page of before are no page of now.
    let mut of_before = pages.clone();
    of_before[0].schema = OLDEST_PAGED_SCHEMA;
    let (_, new) = manifest(0..days)
        .paged_after(known(&of_before, name))
        .unwrap();
    assert_eq!(new, [(pages[0].name(), pages[0].clone())]);
}

#[test]
fn a_step_that_comes_goes_or_is_revised_anywhere_makes_two_pages_at_most() {
    let (_, pages) = manifest(0..2000).paged().unwrap();
    let name = Digest::of(b"known");
    let before = known(&pages, name);
    let new_count = |next: &Manifest| {
        let (paged, new) = next.paged_after(&before).unwrap();
        assert_eq!(
            paged.clone().with_pages(&next.paged().unwrap().1),
            Ok(next.clone())
        );
        new.len()
    };
    let most = |changed: &dyn Fn(usize) -> Manifest| {
        let places = [0, 1, 63, 500, 1024, 1990];
        places.into_iter().map(|at| new_count(&changed(at))).max()
    };
    // One before all others, and one in the midst of them.
    assert!(new_count(&manifest(-1..2000)) <= 2);
    let (_, lacking) = manifest((0..1000).chain(1001..2000)).paged().unwrap();
    let (_, new) = manifest(0..2000)
        .paged_after(known(&lacking, name))
        .unwrap();
    assert!((1..=2).contains(&new.len()), "{}", new.len());
    let dropped = |at: usize| manifest((0..2000).filter(move |day| *day != at as i64));
    assert!(most(&dropped).is_some_and(|most| most <= 2));
    let revised = |at: usize| {
        let mut next = manifest(0..2000);
        next.steps[at].valid_cells += 1;
        next
    };
    assert_eq!(most(&revised), Some(1));
}

#[test]
fn one_more_step_leaves_all_pages_as_they_are() {
    let (before, pages) = manifest(0..300).paged().unwrap();
    for days in 301..400 {
        let (after, _) = manifest(0..days).paged().unwrap();
        assert!(after.pages.starts_with(&before.pages));
    }
    // 67 bytes a page are what a manifest grows by, and what is in none of them is no more than a page may hold.
    let bytes = |days| {
        let (paged, pages) = manifest(0..days).paged().unwrap();
        assert!(paged.rest.steps.len() < MOST_STEPS);
        let text = serde_json::to_vec(&PagedManifest {
            rest: pages[0].clone(),
            ..paged
        });
        (text.unwrap().len(), pages.len())
    };
    let (few, many) = (bytes(300), bytes(5000));
    assert_eq!(few.1, pages.len());
    assert!(many.0 <= few.0 + (many.1 - few.1) * 67);
}
