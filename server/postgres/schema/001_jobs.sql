-- oldest_program: 1
--
-- Jobs, and the queue of those that are not over.
--
--   jobs        one row a job: who asked for what, and how it ended. Written
--               when the job comes, when it ends, and when it goes.
--   live_jobs   a second, narrow row while it is QUEUED or RUNNING: whose turn
--               it is, who runs it, how far that came. This is the table that
--               every worker writes; it stays as small as the queue.
--   tenants     whose turn it is.
--   workers     which processes take jobs, and what they can take.
--   chores      who looks after leases, timeouts and old jobs at the moment.
--
-- All times are those of this database: no clock of another machine counts.

CREATE SCHEMA IF NOT EXISTS isomatch;

CREATE TABLE isomatch.migrations (
  number int PRIMARY KEY,
  name text NOT NULL,
  oldest_program int NOT NULL,
  applied timestamptz NOT NULL DEFAULT now()
);

-- Grows with every change of any job, and with every new job. Numbers of claims
-- and renewals that a crash takes back are given again.
CREATE SEQUENCE isomatch.job_sequence;
CREATE SEQUENCE isomatch.job_number;

CREATE TABLE isomatch.jobs (
  id text PRIMARY KEY,
  number bigint NOT NULL UNIQUE,
  tenant text NOT NULL,
  request_id text NOT NULL,
  -- JobState of the end; of jobs with a row in live_jobs that row's counts.
  state smallint NOT NULL,
  sequence bigint NOT NULL,
  created timestamptz NOT NULL,
  ended timestamptz,
  result_bytes bigint NOT NULL DEFAULT 0,
  labels jsonb NOT NULL,
  -- SHA-256 of the blobs that running it needs.
  inputs text[] NOT NULL,
  -- JobRecord as CBOR; what the columns say counts more.
  record bytea NOT NULL
);
CREATE UNIQUE INDEX jobs_by_request ON isomatch.jobs (tenant, request_id)
  WHERE request_id <> '';
CREATE INDEX jobs_by_tenant ON isomatch.jobs (tenant, number);
CREATE INDEX jobs_ended ON isomatch.jobs (ended) WHERE ended IS NOT NULL;

CREATE TABLE isomatch.live_jobs (
  number bigint PRIMARY KEY,
  id text NOT NULL UNIQUE,
  tenant text NOT NULL,
  state smallint NOT NULL CHECK (state IN (1, 2)),
  sequence bigint NOT NULL,
  priority int NOT NULL,
  shared_priority int NOT NULL,
  memory_bytes bigint NOT NULL,
  attempt int NOT NULL,
  faults int NOT NULL,
  -- Jobs that were started before this one although they came after it.
  passes int NOT NULL DEFAULT 0,
  -- It does not start before: something that it needs is missing.
  not_before timestamptz NOT NULL DEFAULT '-infinity',
  -- How often that was so, and how often in a row since its inputs could not be
  -- read.
  times_held int NOT NULL DEFAULT 0,
  unreadable int NOT NULL DEFAULT 0,
  queue_deadline timestamptz NOT NULL DEFAULT 'infinity',
  -- It is cancelled then, unless somebody watches it.
  watched_until timestamptz NOT NULL DEFAULT 'infinity',
  -- Who runs it, since which claim (a number that was never used before), and
  -- how long it is believed without a word.
  worker text NOT NULL DEFAULT '',
  claim bigint NOT NULL DEFAULT 0,
  lease_until timestamptz NOT NULL DEFAULT 'infinity',
  started timestamptz,
  stage int NOT NULL DEFAULT 0,
  stage_fraction double precision NOT NULL DEFAULT 0,
  total_fraction double precision NOT NULL DEFAULT 0
) WITH (fillfactor = 70, autovacuum_vacuum_scale_factor = 0,
        autovacuum_vacuum_threshold = 1000,
        autovacuum_vacuum_cost_delay = 0);
-- Exactly the order in which a tenant's jobs start.
CREATE INDEX live_jobs_next ON isomatch.live_jobs (tenant, priority DESC, number)
  WHERE state = 1;
CREATE INDEX live_jobs_running ON isomatch.live_jobs (tenant) WHERE state = 2;
-- Whether a worker is large enough for any.
CREATE INDEX live_jobs_smallest ON isomatch.live_jobs (memory_bytes)
  WHERE state = 1;

CREATE TABLE isomatch.tenants (
  tenant text PRIMARY KEY,
  -- The sequence of the claim that served it last.
  last_served bigint NOT NULL DEFAULT 0,
  -- Starts of others of a higher shared_priority since then.
  overtakes int NOT NULL DEFAULT 0
) WITH (fillfactor = 50);

CREATE TABLE isomatch.workers (
  worker text PRIMARY KEY,
  version text NOT NULL,
  -- Jobs at a time, and threads of each.
  slots int NOT NULL,
  threads int NOT NULL,
  memory_bytes bigint NOT NULL,
  seen timestamptz NOT NULL DEFAULT now()
) WITH (fillfactor = 50);

CREATE TABLE isomatch.chores (
  chore text PRIMARY KEY,
  holder text NOT NULL,
  held_until timestamptz NOT NULL
) WITH (fillfactor = 50);

-- A job comes, and needs its inputs: kind 1 of job_blobs (002_blobs.sql).
-- Returns its number and sequence; NULLs when there is one with the same id or,
-- of the tenant, request_id.
CREATE FUNCTION isomatch.insert_job(
  p_id text, p_tenant text, p_request_id text, p_labels jsonb, p_record bytea,
  p_priority int, p_shared_priority int, p_memory_bytes bigint,
  p_queue_timeout interval, p_unwatched_grace interval, p_inputs text[],
  OUT number bigint, OUT sequence bigint, OUT created timestamptz)
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
BEGIN
  number := nextval('isomatch.job_number');
  sequence := nextval('isomatch.job_sequence');
  created := now();
  INSERT INTO isomatch.jobs (id, number, tenant, request_id, state, sequence,
                             created, labels, inputs, record)
    VALUES (p_id, insert_job.number, p_tenant, p_request_id, 1,
            insert_job.sequence, insert_job.created, p_labels, p_inputs,
            p_record)
    ON CONFLICT DO NOTHING;
  IF NOT FOUND THEN
    number := NULL;
    sequence := NULL;
    created := NULL;
    RETURN;
  END IF;
  INSERT INTO isomatch.live_jobs (
      number, id, tenant, state, sequence, priority, shared_priority,
      memory_bytes, attempt, faults, queue_deadline, watched_until)
    VALUES (
      insert_job.number, p_id, p_tenant, 1, insert_job.sequence, p_priority,
      p_shared_priority, p_memory_bytes, 0, 0,
      coalesce(now() + p_queue_timeout, 'infinity'),
      coalesce(now() + p_unwatched_grace, 'infinity'));
  INSERT INTO isomatch.tenants (tenant) VALUES (p_tenant)
    ON CONFLICT DO NOTHING;
  INSERT INTO isomatch.job_blobs (job_id, tenant, sha256, kind)
    SELECT DISTINCT p_id, p_tenant, i.sha256, 1
      FROM unnest(p_inputs) AS i (sha256);
END $$;

-- The next job for a worker that has p_free_bytes of its p_total_bytes left
-- becomes RUNNING; no row when there is none. The order:
--
--   1. of a tenant that was overtaken p_max_overtakes times, as below;
--   2. of the highest shared_priority;
--   3. of the tenant with the fewest running jobs;
--   4. of the tenant that was served least recently;
--   5. the one that came first;
--
-- and of each tenant that of the highest priority, then the one that came
-- first. One that was started so often that it has to run alone needs all of
-- the worker's memory. One that does not fit now may be passed p_max_passes
-- times; after that the worker waits until it fits. One that never fits stays
-- for a larger worker. Of the next few of its tenant and priority one that has a
-- mesh of p_meshes, which the worker has prepared, may pass the others, each as
-- many times.
--
-- Claims come one after the other, each for less than a millisecond: nobody
-- holds the lock while it waits for a network or for the disk.
CREATE FUNCTION isomatch.claim_job(
  p_worker text, p_free_bytes bigint, p_total_bytes bigint, p_lease interval,
  p_max_running_per_tenant int, p_max_passes int, p_max_overtakes int,
  p_alone_after int, p_meshes text[])
RETURNS SETOF isomatch.live_jobs
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
DECLARE
  head record;
  chosen bigint;
  chosen_head record;
  passed bigint[] := '{}';
  preferred bigint;
  -- Whose turn it is next, and the job's sequence.
  served bigint;
BEGIN
  -- A claim that a crash of this database takes back is one that its worker
  -- hears of when it renews its lease.
  PERFORM set_config('synchronous_commit', 'off', true);
  -- Workers without work ask all the time.
  PERFORM FROM isomatch.live_jobs
    WHERE state = 1 AND memory_bytes <= p_total_bytes LIMIT 1;
  IF NOT FOUND THEN
    RETURN;
  END IF;
  PERFORM pg_advisory_xact_lock(22062021);
  FOR head IN
    SELECT t.tenant, t.overtakes, j.number, j.shared_priority, j.passes,
           j.needed, r.running
      FROM isomatch.tenants t
      CROSS JOIN LATERAL (
        SELECT l.number, l.shared_priority, l.passes,
               CASE WHEN l.attempt >= p_alone_after
                    THEN greatest(p_total_bytes, l.memory_bytes)
                    ELSE l.memory_bytes END AS needed
          FROM isomatch.live_jobs l
          WHERE l.tenant = t.tenant AND l.state = 1 AND l.not_before <= now()
            AND l.memory_bytes <= p_total_bytes
          ORDER BY l.priority DESC, l.number LIMIT 1) j
      CROSS JOIN LATERAL (
        SELECT count(*) AS running FROM isomatch.live_jobs l
          WHERE l.tenant = t.tenant AND l.state = 2) r
      WHERE r.running < p_max_running_per_tenant
      ORDER BY t.overtakes >= p_max_overtakes DESC, j.shared_priority DESC,
               r.running, t.last_served, j.number
  LOOP
    IF head.needed <= p_free_bytes THEN
      chosen := head.number;
    ELSIF head.passes >= p_max_passes THEN
      RETURN;
    ELSE
      passed := passed || head.number;
      SELECT l.number INTO chosen FROM isomatch.live_jobs l
        WHERE l.tenant = head.tenant AND l.state = 1 AND l.not_before <= now()
          AND l.attempt < p_alone_after AND l.memory_bytes <= p_free_bytes
        ORDER BY l.priority DESC, l.number LIMIT 1;
    END IF;
    IF chosen IS NOT NULL THEN
      chosen_head := head;
      EXIT;
    END IF;
  END LOOP;
  IF chosen IS NULL THEN
    RETURN;
  END IF;
  IF p_meshes <> '{}' THEN
    SELECT n.number INTO preferred FROM (
        SELECT l.number FROM isomatch.live_jobs l
          JOIN isomatch.live_jobs c ON c.number = chosen
          WHERE l.tenant = c.tenant AND l.state = 1 AND l.priority = c.priority
            AND l.number >= c.number AND c.passes < p_max_passes
            AND l.not_before <= now() AND l.attempt < p_alone_after
            AND c.attempt < p_alone_after AND l.memory_bytes <= p_free_bytes
          ORDER BY l.number LIMIT 8) n
      JOIN isomatch.jobs j ON j.number = n.number
      WHERE j.inputs && p_meshes ORDER BY n.number LIMIT 1;
    IF preferred IS NOT NULL AND preferred <> chosen THEN
      passed := passed || chosen;
      chosen := preferred;
    END IF;
  END IF;
  served := nextval('isomatch.job_sequence');
  RETURN QUERY
    UPDATE isomatch.live_jobs l
      -- No number of the sequence: the crash would take that back, too, and
      -- the next claim of the job would have the same.
      SET state = 2, sequence = served,
          claim = 1 + (random() * (2::double precision ^ 62))::bigint,
          worker = p_worker, lease_until = now() + p_lease, started = now(),
          attempt = l.attempt + 1, stage = 0, stage_fraction = 0,
          total_fraction = 0
      WHERE l.number = chosen AND l.state = 1
      RETURNING l.*;
  IF NOT FOUND THEN  -- it ended at this moment
    RETURN;
  END IF;
  UPDATE isomatch.live_jobs SET passes = passes + 1
    WHERE number = ANY (passed) AND state = 1;
  IF chosen_head.overtakes < p_max_overtakes THEN
    UPDATE isomatch.tenants t SET overtakes = t.overtakes + 1
      WHERE t.tenant <> chosen_head.tenant AND chosen_head.shared_priority > (
        SELECT l.shared_priority FROM isomatch.live_jobs l
          WHERE l.tenant = t.tenant AND l.state = 1
          ORDER BY l.priority DESC, l.number LIMIT 1);
  END IF;
  UPDATE isomatch.tenants SET last_served = served, overtakes = 0
    WHERE tenant = chosen_head.tenant;
END $$;

-- A job's row as it is now: VOLATILE, so that a statement which waited in
-- claim_job finds those that have come meanwhile.
CREATE FUNCTION isomatch.job_now(p_number bigint)
RETURNS SETOF isomatch.jobs
LANGUAGE plpgsql VOLATILE
AS $$
BEGIN
  RETURN QUERY SELECT * FROM isomatch.jobs j WHERE j.number = p_number;
END $$;

-- A job that ran waits again, in its old place: nobody has it, and it has come
-- no way.
CREATE FUNCTION isomatch.requeue_job(
  p_number bigint, p_sequence bigint, p_attempt int, p_faults int,
  p_not_before timestamptz, p_unreadable int, p_queue_deadline timestamptz)
RETURNS void
LANGUAGE sql AS $$
  UPDATE isomatch.live_jobs
    SET state = 1, sequence = p_sequence, attempt = p_attempt,
        faults = p_faults, worker = '', claim = 0, lease_until = 'infinity',
        started = NULL, not_before = p_not_before,
        times_held = times_held + (p_not_before > now())::int,
        unreadable = p_unreadable, queue_deadline = p_queue_deadline,
        stage = 0, stage_fraction = 0, total_fraction = 0
    WHERE number = p_number;
$$;

-- The same of a job whose lease has run out; false when it has not, or when the
-- job is another claim's by now.
CREATE FUNCTION isomatch.take_back_job(p_id text, p_claim bigint, p_faults int)
RETURNS boolean
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
DECLARE
  live isomatch.live_jobs;
BEGIN
  SELECT * INTO live FROM isomatch.live_jobs
    WHERE id = p_id AND claim = p_claim AND state = 2 AND lease_until < now()
    FOR UPDATE;
  IF NOT FOUND THEN RETURN false; END IF;
  PERFORM isomatch.requeue_job(
    live.number, nextval('isomatch.job_sequence'), live.attempt, p_faults,
    live.not_before, live.unreadable, 'infinity');
  RETURN true;
END $$;

-- Replaces a job's record when its sequence is still p_sequence, and its claim
-- p_claim: a crash may have given the number to another change. Once it is over
-- it needs its results, kind 2 of job_blobs, and its inputs no more. Returns the
-- new sequence; 0 when it is another by now, -1 when the job is gone.
CREATE FUNCTION isomatch.update_job(
  p_id text, p_sequence bigint, p_claim bigint, p_state int, p_attempt int,
  p_faults int, p_hold interval, p_unreadable int,
  p_has_queue_timeout boolean, p_stage int, p_stage_fraction double precision, p_total_fraction double precision,
  p_result_bytes bigint, p_results text[], p_record bytea)
RETURNS bigint
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
DECLARE
  new_sequence bigint := nextval('isomatch.job_sequence');
  live isomatch.live_jobs;
  now_at bigint;
BEGIN
  SELECT * INTO live FROM isomatch.live_jobs WHERE id = p_id FOR UPDATE;
  IF NOT FOUND THEN  -- it is over
    SELECT sequence INTO now_at FROM isomatch.jobs WHERE id = p_id FOR UPDATE;
    IF NOT FOUND THEN RETURN -1; END IF;
    IF now_at <> p_sequence OR p_state < 3 THEN RETURN 0; END IF;
    UPDATE isomatch.jobs
      SET state = p_state, sequence = new_sequence, record = p_record WHERE id = p_id;
    RETURN new_sequence;
  END IF;
  IF live.sequence <> p_sequence OR live.claim <> p_claim THEN
    RETURN 0;
  END IF;
  IF p_state >= 3 THEN
    DELETE FROM isomatch.live_jobs WHERE number = live.number;
    UPDATE isomatch.jobs
      SET state = p_state, sequence = new_sequence, record = p_record, ended = now(),
          result_bytes = p_result_bytes
      WHERE id = p_id;
    DELETE FROM isomatch.job_blobs WHERE job_id = p_id;
    INSERT INTO isomatch.job_blobs (job_id, tenant, sha256, kind)
      SELECT DISTINCT p_id, live.tenant, r.sha256, 2
        FROM unnest(p_results) AS r (sha256);
    RETURN new_sequence;
  END IF;
  IF p_state = live.state THEN  -- how far it is, and whose fault it was
    UPDATE isomatch.live_jobs
      SET sequence = new_sequence, attempt = p_attempt, faults = p_faults,
          stage = p_stage, stage_fraction = p_stage_fraction,
          total_fraction = p_total_fraction
      WHERE number = live.number;
    RETURN new_sequence;
  END IF;
  PERFORM isomatch.requeue_job(
    live.number, new_sequence, p_attempt, p_faults,
    coalesce(now() + p_hold, '-infinity'), p_unreadable,
    CASE WHEN p_has_queue_timeout THEN live.queue_deadline
         ELSE 'infinity' END);
  RETURN new_sequence;
END $$;

-- Locks jobs in one order, so that those who change several do not wait for each
-- other in a circle.
CREATE FUNCTION isomatch.lock_live_jobs(p_ids text[])
RETURNS void
LANGUAGE plpgsql AS $$
BEGIN
  PERFORM FROM isomatch.live_jobs WHERE id = ANY (p_ids)
    ORDER BY number FOR NO KEY UPDATE;
END $$;

-- Jobs are watched: they are not cancelled for that until p_grace is over.
CREATE FUNCTION isomatch.keep_watched(p_ids text[], p_grace interval)
RETURNS void
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
BEGIN
  PERFORM FROM isomatch.live_jobs
    WHERE id = ANY (p_ids) AND watched_until < 'infinity'
    ORDER BY number FOR NO KEY UPDATE;
  UPDATE isomatch.live_jobs SET watched_until = now() + p_grace
    WHERE id = ANY (p_ids) AND watched_until < 'infinity';
END $$;

-- A worker goes on with its jobs, this far. Returns those that are still its
-- own.
CREATE FUNCTION isomatch.renew_leases(
  p_ids text[], p_claims bigint[], p_stages int[],
  p_stage_fractions double precision[], p_total_fractions double precision[],
  p_lease interval)
RETURNS SETOF text
LANGUAGE plpgsql
SET lock_timeout TO '3s'
AS $$
BEGIN
  -- What a crash takes back comes with the next renewal.
  PERFORM set_config('synchronous_commit', 'off', true);
  IF cardinality(p_ids) > 1 THEN
    PERFORM isomatch.lock_live_jobs(p_ids);
  END IF;
  RETURN QUERY
    UPDATE isomatch.live_jobs l
      SET lease_until = now() + p_lease, stage = r.stage,
          stage_fraction = r.stage_fraction, total_fraction = r.total_fraction,
          sequence = CASE
            WHEN (l.stage, l.stage_fraction, l.total_fraction)
                 IS DISTINCT FROM (r.stage, r.stage_fraction, r.total_fraction)
            THEN nextval('isomatch.job_sequence') ELSE l.sequence END
      FROM unnest(p_ids, p_claims, p_stages, p_stage_fractions,
                  p_total_fractions)
           AS r (id, claim, stage, stage_fraction, total_fraction)
      WHERE l.id = r.id AND l.claim = r.claim AND l.state = 2
      RETURNING l.id;
END $$;

-- The QUEUED jobs as they start, if each fits and none comes: of the highest
-- shared_priority first, and among those the tenants take turns.
CREATE FUNCTION isomatch.queue_order()
RETURNS SETOF text
LANGUAGE sql STABLE AS $$
  SELECT q.id FROM (
      SELECT l.id, l.number, l.tenant, l.shared_priority, row_number() OVER (
               PARTITION BY l.tenant
               ORDER BY l.not_before <= now() DESC, l.priority DESC, l.number)
               AS turn,
             l.not_before <= now() AS may_start
        FROM isomatch.live_jobs l WHERE l.state = 1) q
    JOIN isomatch.tenants t ON t.tenant = q.tenant
    ORDER BY q.may_start DESC, q.shared_priority DESC, q.turn, t.last_served,
             q.number
$$;
