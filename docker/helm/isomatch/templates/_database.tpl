{{/* Mounts of the database's Secrets are below this. */}}
{{- define "isomatch.secretsFolder" -}}/run/secrets/isomatch{{- end -}}

{{- define "isomatch.databaseUrl" -}}
{{- $db := .Values.database -}}
{{- $url := printf "postgresql://%s@%s:%v/%s?sslmode=%s" $db.user $db.host (int $db.port) $db.name $db.sslMode -}}
{{- if $db.ca.secretName -}}
{{- $url = printf "%s&sslrootcert=%s/database-ca/%s" $url (include "isomatch.secretsFolder" .) $db.ca.key -}}
{{- end -}}
{{- $url -}}
{{- end -}}

{{/* As environment, since a Secret can be read there without being in a ConfigMap, and
     before there is any ConfigMap. */}}
{{- define "isomatch.databaseEnv" -}}
- name: ISOMATCH_STORE
{{- if .Values.database.urlSecret.name }}
  valueFrom:
    secretKeyRef:
      name: {{ .Values.database.urlSecret.name }}
      key: {{ .Values.database.urlSecret.key }}
{{- else }}
  value: {{ include "isomatch.databaseUrl" . | quote }}
{{- end }}
{{- if include "isomatch.hasPassword" . }}
- name: ISOMATCH_STORE_PASSWORD_FILE
  value: {{ include "isomatch.secretsFolder" . }}/database/{{ .Values.database.password.key }}
{{- end }}
{{- end -}}

{{- define "isomatch.hasPassword" -}}
{{- if and .Values.database.password.secretName (not .Values.database.urlSecret.name) }}true{{ end -}}
{{- end -}}

{{- define "isomatch.hasCa" -}}
{{- if and .Values.database.ca.secretName (not .Values.database.urlSecret.name) }}true{{ end -}}
{{- end -}}

{{- define "isomatch.databaseMounts" -}}
{{- if include "isomatch.hasPassword" . }}
- name: database
  mountPath: {{ include "isomatch.secretsFolder" . }}/database
  readOnly: true
{{- end }}
{{- if include "isomatch.hasCa" . }}
- name: database-ca
  mountPath: {{ include "isomatch.secretsFolder" . }}/database-ca
  readOnly: true
{{- end }}
{{- end -}}

{{- define "isomatch.databaseVolumes" -}}
{{- if include "isomatch.hasPassword" . }}
- name: database
  secret:
    secretName: {{ .Values.database.password.secretName }}
    defaultMode: 0440
{{- end }}
{{- if include "isomatch.hasCa" . }}
- name: database-ca
  secret:
    secretName: {{ .Values.database.ca.secretName }}
    defaultMode: 0440
{{- end }}
{{- end -}}
