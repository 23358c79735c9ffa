-- oldest_program: 2
--
-- Bytes under the SHA-256 of their content, of each tenant for itself.
--
--   blobs        one row a blob: how large it is, and when it was last used.
--   blob_chunks  its content, in rows that are written once, unless it is in a
--                file of a folder that all processes share.
--   job_blobs    which jobs need which blobs. Whoever changes a job changes its
--                rows here in the same transaction. What has a row stays.
--   blob_totals  how many bytes each tenant has. Changed last in a transaction,
--                since others of the tenant wait for its end then.
--   blob_folder  one row: what the folder of files says that belongs to this
--                database, and whether there is such a folder.
--   dropped_files  files whose rows are gone, until somebody has removed them.
--   blob_probe   empty; what is written here to see whether it can be is taken
--                back.
--
-- All times are those of this database.

CREATE TABLE isomatch.blobs (
  tenant text NOT NULL,
  sha256 text NOT NULL,
  bytes bigint NOT NULL CHECK (bytes >= 0),
  chunks int NOT NULL CHECK (chunks >= 0),
  -- The content was found not to be what was put; as good as missing.
  is_damaged boolean NOT NULL DEFAULT false,
  put_at timestamptz NOT NULL,
  -- May be behind by as much as callers of use_blob want.
  used_at timestamptz NOT NULL,
  -- Somebody has removed it while it could not go yet: it goes then, unless it
  -- was used meanwhile.
  remove_at timestamptz,
  -- TENANT/AB/SHA256.RANDOM in the folder; NULL when it is in blob_chunks.
  file text CHECK (file IS NULL OR chunks = 0),
  PRIMARY KEY (tenant, sha256)
) WITH (fillfactor = 80);
CREATE INDEX blobs_by_use ON isomatch.blobs (used_at);
CREATE INDEX blobs_to_remove ON isomatch.blobs (remove_at)
  WHERE remove_at IS NOT NULL;

CREATE UNIQUE INDEX blobs_by_file ON isomatch.blobs (file)
  WHERE file IS NOT NULL;

CREATE TABLE isomatch.dropped_files (file text PRIMARY KEY);

CREATE TABLE isomatch.blob_folder (mark text NOT NULL, is_marked boolean NOT NULL);
INSERT INTO isomatch.blob_folder VALUES (gen_random_uuid()::text, false);

CREATE TABLE isomatch.blob_chunks (
  tenant text NOT NULL,
  sha256 text NOT NULL,
  index int NOT NULL,
  -- 256 KiB each, but for the last one.
  content bytea NOT NULL,
  PRIMARY KEY (tenant, sha256, index),
  FOREIGN KEY (tenant, sha256) REFERENCES isomatch.blobs ON DELETE CASCADE
);
-- Meshes and maps come compressed.
ALTER TABLE isomatch.blob_chunks ALTER COLUMN content SET STORAGE EXTERNAL;

CREATE TABLE isomatch.job_blobs (
  job_id text NOT NULL,
  tenant text NOT NULL,
  sha256 text NOT NULL,
  -- 1: an input, 2: a part of the result.
  kind smallint NOT NULL,
  PRIMARY KEY (job_id, sha256, kind),
  FOREIGN KEY (tenant, sha256) REFERENCES isomatch.blobs
);
CREATE INDEX job_blobs_by_blob ON isomatch.job_blobs (tenant, sha256);

CREATE TABLE isomatch.blob_totals (
  tenant text PRIMARY KEY,
  bytes bigint NOT NULL
) WITH (fillfactor = 50);

CREATE TABLE isomatch.blob_probe (content bytea NOT NULL);
ALTER TABLE isomatch.blob_probe ALTER COLUMN content SET STORAGE EXTERNAL;

-- Those that no job needs.
CREATE VIEW isomatch.unused_blobs AS
  SELECT b.tenant, b.sha256, b.bytes, b.used_at, b.remove_at
    FROM isomatch.blobs b
    WHERE NOT EXISTS (SELECT FROM isomatch.job_blobs r
                        WHERE r.tenant = b.tenant AND r.sha256 = b.sha256);

-- Uses a blob, and returns what it is; no row when it is not there. `version`
-- is another one each time that the content is put. The time of use is written
-- only when it is older than p_resolution, or when the blob would be removed:
-- two statements, so that nobody who removes it, or uses it as well, comes
-- between them unseen.
CREATE FUNCTION isomatch.use_blob(
  p_tenant text, p_sha256 text, p_resolution interval)
RETURNS TABLE (bytes bigint, chunks int, file text, version bigint)
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
BEGIN
  UPDATE isomatch.blobs b SET used_at = clock_timestamp(), remove_at = NULL
    WHERE b.tenant = p_tenant AND b.sha256 = p_sha256
      AND (b.used_at <= now() - p_resolution OR b.remove_at IS NOT NULL);
  RETURN QUERY
    SELECT b.bytes, b.chunks, b.file,
           (extract(epoch FROM b.put_at) * 1000000)::bigint
      FROM isomatch.blobs b
      WHERE b.tenant = p_tenant AND b.sha256 = p_sha256 AND NOT b.is_damaged;
END $$;

-- The same of many: returns the digests of those that are there. Only what this
-- statement has locked, in the order of all who lock several, is written.
CREATE FUNCTION isomatch.use_blobs(
  p_tenant text, p_sha256s text[], p_resolution interval)
RETURNS SETOF text
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
BEGIN
  WITH stale AS MATERIALIZED (
    SELECT b.tenant, b.sha256 FROM isomatch.blobs b
      WHERE b.tenant = p_tenant AND b.sha256 = ANY (p_sha256s)
        AND (b.used_at <= now() - p_resolution OR b.remove_at IS NOT NULL)
      ORDER BY b.tenant, b.sha256 FOR NO KEY UPDATE)
  UPDATE isomatch.blobs b SET used_at = clock_timestamp(), remove_at = NULL
    FROM stale s WHERE b.tenant = s.tenant AND b.sha256 = s.sha256;
  RETURN QUERY
    SELECT b.sha256 FROM isomatch.blobs b
      WHERE b.tenant = p_tenant AND b.sha256 = ANY (p_sha256s)
        AND NOT b.is_damaged;
END $$;

-- Begins to put a blob. Returns NULL when it is there, which counts as a use;
-- or else by how many bytes the tenant has more. Then the transaction has to
-- insert its chunks, and to end with count_blob_bytes. Waits for whoever puts
-- the same at this moment.
CREATE FUNCTION isomatch.put_blob(
  p_tenant text, p_sha256 text, p_bytes bigint, p_chunks int, p_file text)
RETURNS bigint
LANGUAGE plpgsql AS $$
DECLARE
  present isomatch.blobs;
BEGIN
  LOOP
    INSERT INTO isomatch.blobs
        (tenant, sha256, bytes, chunks, file, put_at, used_at)
      VALUES (p_tenant, p_sha256, p_bytes, p_chunks, p_file,
              clock_timestamp(), clock_timestamp())
      ON CONFLICT DO NOTHING;
    IF FOUND THEN
      RETURN p_bytes;
    END IF;
    SELECT * INTO present FROM isomatch.blobs
      WHERE tenant = p_tenant AND sha256 = p_sha256 FOR NO KEY UPDATE;
    EXIT WHEN FOUND;  -- or else it was removed meanwhile
  END LOOP;
  UPDATE isomatch.blobs SET used_at = clock_timestamp(), remove_at = NULL
    WHERE tenant = p_tenant AND sha256 = p_sha256;
  IF NOT present.is_damaged THEN
    RETURN NULL;
  END IF;
  DELETE FROM isomatch.blob_chunks
    WHERE tenant = p_tenant AND sha256 = p_sha256;
  INSERT INTO isomatch.dropped_files
    SELECT present.file WHERE present.file IS NOT NULL;
  UPDATE isomatch.blobs
    SET is_damaged = false, bytes = p_bytes, chunks = p_chunks, file = p_file,
        put_at = clock_timestamp()
    WHERE tenant = p_tenant AND sha256 = p_sha256;
  RETURN p_bytes - present.bytes;
END $$;

CREATE FUNCTION isomatch.count_blob_bytes(p_tenant text, p_bytes bigint)
RETURNS void
LANGUAGE sql AS $$
  INSERT INTO isomatch.blob_totals AS t (tenant, bytes)
    VALUES (p_tenant, p_bytes)
    ON CONFLICT (tenant) DO UPDATE SET bytes = t.bytes + excluded.bytes;
$$;

-- Locks a blob that was not used within p_grace, and says whether it did: not
-- when somebody uses it, or makes a job that needs it, at this moment.
CREATE FUNCTION isomatch.lock_old_blob(
  p_tenant text, p_sha256 text, p_grace interval)
RETURNS boolean
LANGUAGE plpgsql AS $$
BEGIN
  PERFORM FROM isomatch.blobs
    WHERE tenant = p_tenant AND sha256 = p_sha256
      AND used_at <= now() - p_grace
    FOR UPDATE SKIP LOCKED;
  RETURN FOUND;
END $$;

-- Deletes a blob that lock_old_blob has locked, unless a job needs it; returns
-- how many bytes. From the lock on nobody can add a row of job_blobs that names
-- it, and this statement, a later one, sees those that were added before.
CREATE FUNCTION isomatch.delete_locked_blob(p_tenant text, p_sha256 text)
RETURNS bigint
LANGUAGE plpgsql AS $$
DECLARE
  freed bigint;
  dropped text;
BEGIN
  DELETE FROM isomatch.blobs b
    WHERE b.tenant = p_tenant AND b.sha256 = p_sha256
      AND NOT EXISTS (SELECT FROM isomatch.job_blobs r
                        WHERE r.tenant = p_tenant AND r.sha256 = p_sha256)
    RETURNING b.bytes, b.file INTO freed, dropped;
  IF NOT FOUND THEN
    RETURN 0;
  END IF;
  INSERT INTO isomatch.dropped_files SELECT dropped WHERE dropped IS NOT NULL;
  PERFORM isomatch.count_blob_bytes(p_tenant, -freed);
  RETURN freed;
END $$;

-- Whoever deletes blobs of several tenants does it alone, so that two do not both
-- delete what one of them needs, nor wait for each other's totals.
CREATE FUNCTION isomatch.lock_many_blobs()
RETURNS void
LANGUAGE sql AS $$
  SELECT pg_advisory_xact_lock(x'150A7C6'::int);
$$;

-- Removes a blob that no job needs; one that was used within p_grace once that
-- is over, by remove_due_blobs.
CREATE FUNCTION isomatch.remove_blob(
  p_tenant text, p_sha256 text, p_grace interval)
RETURNS void
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
BEGIN
  IF isomatch.lock_old_blob(p_tenant, p_sha256, p_grace) THEN
    PERFORM isomatch.delete_locked_blob(p_tenant, p_sha256);
    RETURN;
  END IF;
  UPDATE isomatch.blobs b SET remove_at = b.used_at + p_grace
    WHERE b.tenant = p_tenant AND b.sha256 = p_sha256
      AND b.used_at > now() - p_grace
      AND NOT EXISTS (SELECT FROM isomatch.job_blobs r
                        WHERE r.tenant = p_tenant AND r.sha256 = p_sha256);
END $$;

-- What a job that is removed leaves goes once p_grace is over, unless another
-- needs it or somebody uses it until then. Whoever removes the job may remove
-- it sooner, if he lives that long.
CREATE FUNCTION isomatch.remove_blobs_later(
  p_tenants text[], p_sha256s text[], p_grace interval)
RETURNS void
LANGUAGE plpgsql AS $$
BEGIN
  PERFORM FROM isomatch.blobs b
    WHERE (b.tenant, b.sha256) IN (
      SELECT r.tenant, r.sha256 FROM unnest(p_tenants, p_sha256s)
                                     AS r (tenant, sha256))
    ORDER BY b.tenant, b.sha256 FOR NO KEY UPDATE;
  UPDATE isomatch.blobs b SET remove_at = now() + p_grace
    FROM unnest(p_tenants, p_sha256s) AS r (tenant, sha256)
    WHERE b.tenant = r.tenant AND b.sha256 = r.sha256;
END $$;

-- Removes the blobs that are due, p_most of them; returns how many those were.
CREATE FUNCTION isomatch.remove_due_blobs(p_grace interval, p_most int)
RETURNS int
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
DECLARE
  blob record;
  removed int := 0;
BEGIN
  PERFORM isomatch.lock_many_blobs();
  FOR blob IN
    SELECT u.tenant, u.sha256 FROM isomatch.unused_blobs u
      WHERE u.remove_at <= now() AND u.used_at <= now() - p_grace
      ORDER BY u.remove_at LIMIT p_most
  LOOP
    CONTINUE WHEN NOT isomatch.lock_old_blob(blob.tenant, blob.sha256, p_grace);
    PERFORM isomatch.delete_locked_blob(blob.tenant, blob.sha256);
    removed := removed + 1;
  END LOOP;
  RETURN removed;
END $$;

-- How many bytes are too many beside p_bytes for this blob: of its tenant
-- (p_of_tenant) or of all, where p_limit is the most.
CREATE FUNCTION isomatch.missing_blob_bytes(
  p_tenant text, p_sha256 text, p_bytes bigint, p_limit bigint,
  p_of_tenant boolean)
RETURNS bigint
LANGUAGE sql AS $$
  SELECT (coalesce((SELECT sum(t.bytes) FROM isomatch.blob_totals t
                      WHERE NOT p_of_tenant OR t.tenant = p_tenant), 0)
          - coalesce((SELECT b.bytes FROM isomatch.blobs b  -- damaged
                        WHERE b.tenant = p_tenant AND b.sha256 = p_sha256), 0)
          + p_bytes - p_limit)::bigint;
$$;

-- Makes room for a blob: deletes others (p_of_tenant: of its tenant) that no
-- job needs and that were not used within p_grace, the least recently used
-- first, until the rest and p_bytes are at most p_limit. Returns how many bytes
-- are still to be deleted, by the next call, since one deletes 500 blobs or 64
-- MiB at most: 0 when there is room. NULL, and nothing is deleted, when it
-- cannot be made; -1 when it might be, but for blobs that somebody else has
-- locked at this moment, to use or to delete them.
CREATE FUNCTION isomatch.make_blob_room(
  p_tenant text, p_sha256 text, p_bytes bigint, p_limit bigint,
  p_of_tenant boolean, p_grace interval)
RETURNS bigint
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
DECLARE
  missing bigint;
  blob record;
  may_go bigint := 0;
  locked bigint := 0;
  tenants text[] := '{}';
  digests text[] := '{}';
  freed bigint := 0;
BEGIN
  IF isomatch.missing_blob_bytes(p_tenant, p_sha256, p_bytes, p_limit,
                                 p_of_tenant) <= 0 THEN
    RETURN 0;
  END IF;
  PERFORM isomatch.lock_many_blobs();
  missing := isomatch.missing_blob_bytes(p_tenant, p_sha256, p_bytes, p_limit,
                                         p_of_tenant);
  IF missing <= 0 THEN
    RETURN 0;
  END IF;
  FOR blob IN
    SELECT u.tenant, u.sha256, u.bytes FROM isomatch.unused_blobs u
      WHERE (NOT p_of_tenant OR u.tenant = p_tenant)
        AND (u.tenant, u.sha256) <> (p_tenant, p_sha256)
        AND u.used_at <= now() - p_grace
      ORDER BY u.used_at
  LOOP
    IF cardinality(digests) < 500 THEN
      IF NOT isomatch.lock_old_blob(blob.tenant, blob.sha256, p_grace) THEN
        locked := locked + blob.bytes;
        CONTINUE;
      END IF;
      tenants := tenants || blob.tenant;
      digests := digests || blob.sha256;
    END IF;
    may_go := may_go + blob.bytes;
    EXIT WHEN may_go >= missing;
  END LOOP;
  IF may_go < missing THEN
    RETURN CASE WHEN may_go + locked >= missing THEN -1 END;
  END IF;
  FOR i IN 1 .. cardinality(digests) LOOP
    freed := freed + isomatch.delete_locked_blob(tenants[i], digests[i]);
    EXIT WHEN freed >= 64 * 1024 * 1024;
  END LOOP;
  RETURN greatest(missing - freed, 0);
END $$;
