use super::*;

/// A map of several containers of 2^16 cells: dense, sparse, in runs, and none.
const COUNT: usize = 200_003;

fn is_some(cell: usize) -> bool {
    match cell {
        0..60_000 => cell.is_multiple_of(3) || cell.is_multiple_of(7),
        60_000..65_530 => false,
        65_530..140_000 => !cell.is_multiple_of(997),
        _ => cell.is_multiple_of(61) || cell == COUNT - 1,
    }
}

fn values() -> Vec<f32> {
    let value = |cell| if is_some(cell) { 1.0 } else { f32::NAN };
    (0..COUNT).map(value).collect()
}

fn product() -> ProductId {
    "p".parse().unwrap()
}

/// Lays bytes out under their own name.
async fn stored(store: &Store, content: &[u8]) -> ObjectKey {
    let key = ObjectKey::domain(&product(), &Digest::of(content));
    let content = Bytes::copy_from_slice(content);
    store.put_over(&key, content).await.unwrap();
    key
}

#[tokio::test]
async fn a_domain_round_trips() {
    let store = Store::memory();
    let cells = [true, false, true];
    let key = write(&store, &product(), &cells).await.unwrap();
    assert_eq!(read(&store, &key).await.unwrap(), cells);
    store
        .put_over(&key, Bytes::from(vec![1, 0, 0]))
        .await
        .unwrap();
    let error = read(&store, &key).await.unwrap_err();
    assert!(error.to_string().contains(key.as_str()), "{error}");
    let error = read_cells(&store, &key).await.unwrap_err();
    assert!(error.to_string().contains(key.as_str()), "{error}");
}

/// Another library of Roaring bitmaps writes the same bytes of the same set (pyroaring 1.2.0, `BitMap.run_optimize`).
#[test]
fn a_stored_domain_is_what_its_form_says() {
    let few: Vec<bool> = (0..12).map(|cell| cell < 10 && cell != 1).collect();
    let expected = [
        70, 71, 68, 77, 2, 0, 0, 0, 12, 0, 0, 0, 0, 0, 0, 0, 59, 48, 0, 0, 1, 0, 0, 8, 0, 2, 0, 0,
        0, 0, 0, 2, 0, 7, 0,
    ];
    assert_eq!(content(Cells::of(&few)), expected);
    let none = [
        70, 71, 68, 77, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 58, 48, 0, 0, 0, 0, 0, 0,
    ];
    assert_eq!(content(Cells::none(3)), none);
    let many: Vec<bool> = (0..COUNT).map(is_some).collect();
    let many = content(Cells::of(&many));
    assert_eq!(
        (many.len(), Digest::of(&many).to_string().as_str()),
        (
            12_381,
            "988b0335fd7e24f5be0b7a8f1e88bf518554166f4ace3c917d330853fa2c4861"
        )
    );
}

#[tokio::test]
async fn the_same_cells_are_the_same_object_however_they_were_found() {
    let (store, values) = (Store::memory(), values());
    let in_bands = |band: usize| {
        let mut cells = Cells::none(COUNT);
        for (index, values) in values.chunks(band).enumerate().rev() {
            cells.add_valued(index * band, values);
        }
        cells
    };
    let flags: Vec<bool> = (0..COUNT).map(is_some).collect();
    let key = write(&store, &product(), &flags).await.unwrap();
    let read = read_cells(&store, &key).await.unwrap();
    let mut one_by_one = Cells::none(COUNT);
    for cell in (0..COUNT).rev().filter(|cell| is_some(*cell)) {
        one_by_one.insert(cell);
    }
    let mut taken_away = Cells::of(&vec![true; COUNT]);
    taken_away.set.optimize();
    let others: Vec<bool> = flags.iter().map(|flag| !flag).collect();
    taken_away.remove(&Cells::of(&others));
    let mut of_ranges = Cells::none(COUNT);
    for run in read.runs(0..COUNT) {
        of_ranges.set.insert_range(run.start as u32..run.end as u32);
    }
    let mut joined = Cells::none(COUNT);
    let [mut first, mut second] = [read.clone(), read.clone()];
    first.remove_valued(0, &values[..70_000]);
    second.remove_valued(70_000, &values[70_000..]);
    joined.add(&second);
    joined.add(&first);
    let mut read_and_changed = read.clone();
    let some = vec![1.0; 5_000];
    read_and_changed.add_valued(60_000, &some);
    read_and_changed.remove_valued(60_000, &some);
    // Runs that are larger than what else they could be.
    let mut all_runs = of_ranges.clone();
    all_runs.set |= &read.set;
    for cells in [
        read,
        in_bands(COUNT),
        in_bands(1000),
        in_bands(65_536),
        in_bands(8 * 1021),
        in_bands(13),
        one_by_one,
        taken_away,
        of_ranges,
        joined,
        read_and_changed,
        all_runs,
    ] {
        let found = write_cells(&store, &product(), cells).await.unwrap();
        assert_eq!(found, key);
    }
}

#[tokio::test]
async fn a_domain_of_before_is_read_a_byte_a_cell() {
    let store = Store::memory();
    let flags: Vec<bool> = (0..COUNT).map(is_some).collect();
    let bytes: Vec<u8> = flags.iter().map(|&flag| u8::from(flag)).collect();
    for (flags, bytes) in [(&flags[..], &bytes[..]), (&flags[1..], &bytes[1..])] {
        let key = stored(&store, bytes).await;
        check(&key, bytes).unwrap();
        assert_eq!(read(&store, &key).await.unwrap(), flags);
        let cells = read_cells(&store, &key).await.unwrap();
        assert_eq!(cells, Cells::of(flags));
        let now = write_cells(&store, &product(), cells).await.unwrap();
        assert_ne!(now, key);
        assert_eq!(read(&store, &now).await.unwrap(), flags);
    }
    let empty = stored(&store, b"").await;
    assert_eq!(read_cells(&store, &empty).await.unwrap(), Cells::none(0));
    let neither = stored(&store, &[0, 1, 2]).await;
    let error = read_cells(&store, &neither).await.unwrap_err().to_string();
    assert!(error.contains("a byte is not 0 or 1"), "{error}");
    // As it comes from a network: in pieces of any length.
    let mut reading = Reading::Nothing;
    for piece in bytes.chunks(8_191) {
        reading.take(piece).unwrap();
        reading.take(&[]).unwrap();
    }
    assert_eq!(reading.finish().unwrap(), Cells::of(&flags));
}

/// Bytes that are those of their name and lie.
#[tokio::test]
async fn a_domain_that_lies_is_refused_by_name() {
    let store = Store::memory();
    let flags: Vec<bool> = (0..COUNT).map(is_some).collect();
    let whole = content(Cells::of(&flags));
    let with = |at: usize, bytes: &[u8]| {
        let mut content = whole.clone();
        content[at..at + bytes.len()].copy_from_slice(bytes);
        content
    };
    let few = content(Cells::of(&[true, false, true]));
    // Of the few: the only container holds two cells, told as their number less one at 26, as bytes from 32 on.
    let of_few = |at: usize, byte: u8| {
        let mut content = few.clone();
        content[at] = byte;
        content
    };
    let count = |count: u64| with(8, &count.to_le_bytes());
    let longer = [&whole[..], &[0]].concat();
    let much_longer = [&few[..], &[0; 10_000]].concat();
    let cases: [(Vec<u8>, &str); 15] = [
        (b"no domain".to_vec(), "it ends after 9 bytes"),
        (with(0, b"X"), "it does not begin as a domain does"),
        (with(4, &[3]), "version 3"),
        (count((1 << 31) + 1), "more than the 2147483648 cells"),
        (count(u64::MAX), "more than the 2147483648 cells"),
        (count(COUNT as u64 - 1), "cell 200002 of a map of 200002"),
        (count(0), "its set has more than 16 bytes"),
        (whole[..whole.len() - 1].to_vec(), "its set cannot be read"),
        (whole[..20].to_vec(), "its set cannot be read"),
        (longer, "not what it says of its parts"),
        (much_longer, "its set has more than 8224 bytes"),
        (with(16, &[1]), "its set cannot be read"),
        (of_few(20, 2), "its set cannot be read"),
        (of_few(28, 17), "not what it says of its parts"),
        (of_few(34, 0), "its set cannot be read"),
    ];
    for (content, expected) in cases {
        let key = stored(&store, &content).await;
        let read = read_cells(&store, &key).await.map(|_cells| ());
        for found in [read, check(&key, &content)] {
            let error = found.unwrap_err();
            assert!(matches!(error, StorageError::Damaged { .. }), "{error}");
            let error = error.to_string();
            assert!(error.contains(expected), "{expected}: {error}");
            assert!(error.contains(key.as_str()), "{error}");
        }
    }
    let most = content(Cells::none(MAX_CELLS as usize));
    let key = stored(&store, &most).await;
    let read = read_cells(&store, &key).await.unwrap();
    assert_eq!((read.map_count(), read.is_any()), (1 << 31, false));
}

#[test]
fn another_byte_anywhere_is_refused_or_another_domain() {
    let flags: Vec<bool> = (0..3_000)
        .map(|cell| cell % 700 < 300 || cell % 11 == 0)
        .collect();
    let domain = Cells::of(&flags);
    let whole = content(domain.clone());
    for at in 0..whole.len() {
        for byte in [0, 1, 2, 127, 128, 255] {
            let mut other = whole.clone();
            other[at] = byte;
            let mut reading = Reading::Nothing;
            let read = reading.take(&other).and_then(|()| reading.finish());
            if let Ok(read) = read {
                assert_eq!(read == domain, other == whole, "byte {at} is {byte}");
                assert!(at >= 8 || other == whole, "byte {at} is {byte}");
            }
        }
    }
}
